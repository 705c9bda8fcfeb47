"""Reads raw scores and averages them over scenes.

A raw file holds one column of one data set: a line per scene, region, window and uniqueness, with
errors over matched pixels that have ground truth and the share of such pixels left unmatched.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from sgf_paper.stereo_config import Parameters, Sweep, TableBlock

ERRORS = ["mean_px", "bad1_pct", "bad2_pct", "bad4_pct", "d1_pct"]
RAW_COLUMNS = [
    "dataset", "scene", "region", "matcher", "column", "window", "uniqueness",
    "truth_px", "matched_px", *ERRORS, "invalid_pct",
]  # fmt: skip


class ScoresError(Exception):
    """A raw file that is not what it must be; the text names the file."""


def raw_path(raw: Path, sweep: str, dataset: str, column: str) -> Path:
    """Where the raw scores of a column lie."""
    return raw / sweep / dataset / f"{column}.csv"


def _read_raw(path: Path) -> pd.DataFrame:
    frame = pd.read_csv(path, dtype={"scene": str, "column": str})
    missing = [name for name in RAW_COLUMNS if name not in frame.columns]
    if missing:
        raise ScoresError(f"{path}: no column {', '.join(missing)}")
    if frame.empty:
        raise ScoresError(f"{path}: no scores")
    return frame


def read_scores(raw: Path, sweep: Sweep, dataset: str) -> pd.DataFrame:
    """Raw scores of all columns on one data set, with the share of pixels kept as `kept_pct`."""
    frames = [_read_raw(raw_path(raw, sweep.name, dataset, column)) for column in sweep.columns]
    scores = pd.concat(frames, ignore_index=True)
    scores["kept_pct"] = 100.0 - scores["invalid_pct"]
    return scores


def regions_of(scores: pd.DataFrame) -> list[str]:
    """Regions that the scores hold, `all` first."""
    return [region for region in ("all", "noc") if (scores["region"] == region).any()]


def at(scores: pd.DataFrame, parameters: Parameters) -> pd.DataFrame:
    """The lines of one parameter set."""
    return scores[
        (scores["window"] == parameters.window) & (scores["uniqueness"] == parameters.uniqueness)
    ]


def at_fixed(scores: pd.DataFrame, block: TableBlock) -> pd.DataFrame:
    """The lines of each column's fixed parameter set, in the sweep's order of columns."""
    parts = [
        at(scores[scores["column"] == column], block.parameters(column))
        for column in block.sweep.columns
    ]
    return pd.concat(parts, ignore_index=True)


def measure(scenes: pd.Series, quantity: str) -> tuple[float, int]:
    """A table's value from one score per scene, and the number of scenes with a score.

    `median_px` is the median over scenes of their mean errors, all else a mean over scenes.
    """
    values = scenes.dropna()
    if values.empty:
        return float("nan"), 0
    return float(values.median() if quantity == "median_px" else values.mean()), len(values)


def score_name(quantity: str) -> str:
    """The per-scene score behind a table's quantity."""
    return "mean_px" if quantity == "median_px" else quantity


def curve(scores: pd.DataFrame, window: int) -> pd.DataFrame:
    """Means over scenes at each uniqueness of a window, sorted by the share of pixels kept.

    A point that lacks a score of any scene (no pixel matched) is left out: its mean would be over
    other scenes than its neighbours'.
    """
    groups = scores[scores["window"] == window].groupby("uniqueness")[["kept_pct", *ERRORS]]
    complete = groups.count().eq(groups.size(), axis="index").all(axis="columns")
    return groups.mean()[complete].sort_values("kept_pct").reset_index()


def interpolate(points: pd.DataFrame, quantity: str, kept_pct: float) -> float:
    """The value of a curve at a share of pixels kept, linear; NaN outside the curve."""
    kept = points["kept_pct"].to_numpy()
    if len(kept) == 0:
        return float("nan")
    values = points[quantity].to_numpy()
    return float(np.interp(kept_pct, kept, values, left=np.nan, right=np.nan))
