"""Two-fold cross-validation over scenes: parameters chosen on one fold are scored on the other.

Every column is tuned on the same grid for the same objective at the same share of pixels kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from sgf_paper.scores import at, curve, interpolate
from sgf_paper.stereo_config import Parameters, Tuning


@dataclass(frozen=True)
class Choice:
    """Parameters that a column got from its training fold."""

    column: str
    fold: int  # the fold that these parameters score
    parameters: Parameters
    reached: bool  # whether any parameters keep the wanted share of pixels


def assign_folds(scenes: list[str], near_duplicates: list[list[str]]) -> dict[str, int]:
    """Deals scenes, sorted by name, to folds 0 and 1 in turn; near-duplicates go together."""
    leader = {name: group[0] for group in near_duplicates for name in group}
    clusters = sorted({leader.get(scene, scene) for scene in scenes})
    return {scene: clusters.index(leader.get(scene, scene)) % 2 for scene in scenes}


def _nearest(points: pd.DataFrame, kept_pct: float) -> pd.Series:
    return points.loc[(points["kept_pct"] - kept_pct).abs().idxmin()]


def _best_window(curves: dict[int, pd.DataFrame], tuning: Tuning) -> int | None:
    """Window with the least objective at the wanted share; None if no curve gets there."""
    values = {
        window: interpolate(points, tuning.objective, tuning.kept_pct)
        for window, points in curves.items()
    }
    reached = {window: value for window, value in values.items() if value == value}
    return min(reached, key=reached.__getitem__, default=None)


def _closest_window(curves: dict[int, pd.DataFrame], tuning: Tuning) -> int:
    """Window that comes nearest to the wanted share; among equals the lesser objective."""

    def distance(window: int) -> tuple[float, float]:
        point = _nearest(curves[window], tuning.kept_pct)
        return abs(point["kept_pct"] - tuning.kept_pct), point[tuning.objective]

    return min(curves, key=distance)


def choose(train: pd.DataFrame, tuning: Tuning) -> tuple[Parameters, bool] | None:
    """Best parameters for one column on its training scenes, and whether they keep enough pixels.

    For each window the objective is read off the density curve at the wanted share; the best window
    is taken, with the uniqueness whose share is nearest. None if no curve has a point.
    """
    curves = {int(window): curve(train, window) for window in sorted(train["window"].unique())}
    curves = {window: points for window, points in curves.items() if not points.empty}
    if not curves:
        return None
    best = _best_window(curves, tuning)
    window = _closest_window(curves, tuning) if best is None else best
    point = _nearest(curves[window], tuning.kept_pct)
    return Parameters(window, point["uniqueness"]), best is not None


def cross_validate(
    scores: pd.DataFrame, tuning: Tuning, folds: dict[str, int]
) -> tuple[pd.DataFrame, list[Choice]]:
    """Scores of all columns of one region, each scene under the other fold's parameters.

    @returns the per-scene lines and the choices; both empty with fewer than two folds of scenes.
    """
    fold_of = scores["scene"].map(folds)
    parts, choices = [], []
    for column in scores["column"].unique():
        for fold in (0, 1):
            own = scores[(scores["column"] == column) & (fold_of == fold)]
            train = scores[(scores["column"] == column) & (fold_of == 1 - fold)]
            chosen = None if own.empty or train.empty else choose(train, tuning)
            if chosen:
                choices.append(Choice(column, fold, *chosen))
                parts.append(at(own, chosen[0]))
    lines = pd.concat(parts, ignore_index=True) if parts else scores.iloc[:0]
    return lines, choices
