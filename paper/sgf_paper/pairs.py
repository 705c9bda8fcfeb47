"""Methods against each other, pair by pair: on the same scenes, or in runs under the same circumstances.

Of the lines of a table two make a pair where they agree in some columns. An error is infinite where a run fails: that
counts against it, and pairs in which both fail have nothing to say but are counted. Pairs are independent only
between clusters (near-duplicates of a scene, runs that begin alike, a sequence): those are what the bootstrap draws.
"""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass, replace

import numpy as np
import pandas as pd
from scipy import stats

from sgf_paper import config, paired
from sgf_paper.report_config import ReportPairs

ROW = [
    "experiment", "where", "clusters_are", "own", "other", "pairs", "clusters", "own_failed", "other_failed",
    "both_failed", "unpaired", "won", "lost", "tied", "ratio", "low", "high", "verdict",
]  # fmt: skip


@dataclass(frozen=True)
class Rule:
    """What counts as decided."""

    least: int  # clusters, and runs where lines are of runs
    margin_pct: float


@dataclass(frozen=True)
class Result:
    """How the errors of a method compare with another's."""

    pairs: int  # in which both have an error, if only an infinite one
    clusters: int
    own_failed: int
    other_failed: int
    both_failed: int
    unpaired: int  # lines of one method without one of the other
    won: int
    lost: int
    tied: int
    ratio: float  # median, own over other
    low: float
    high: float
    verdict: str
    enough: bool  # clusters for a verdict

    def __str__(self) -> str:
        shown = f"{self.ratio:.2f} [{self.low:.2f}, {self.high:.2f}]".replace("inf", "∞").replace("nan", "–")
        failed = f", failed {self.own_failed} and {self.other_failed}" if self.own_failed + self.other_failed else ""
        return (
            f"{shown}, {self.won} won, {self.lost} lost, {self.tied} tied of {self.pairs}{failed}: {self.verdict}"
        )


def side_by_side(lines: pd.DataFrame, method: str, quantity: str, keys: list[str]) -> pd.DataFrame:
    """Errors of all methods in columns, a line for what agrees in `keys`."""
    return lines.pivot(index=list(dict.fromkeys(keys)), columns=method, values=quantity)


def pair_up(errors: pd.DataFrame, own: str, other: str) -> tuple[pd.DataFrame, int]:
    """Errors of two methods, and how many have no partner."""
    either = errors.reindex(columns=[own, other]).dropna(how="all")
    both = either.dropna()
    return both, len(either) - len(both)


def compare(wide: pd.DataFrame, unpaired: int, clusters: list[str], rule: Rule) -> Result:
    """Compares the two columns of errors, pair by pair.

    @param unpaired how many had no partner. @param clusters names of levels of the index.
    """
    own, other = (wide[name].to_numpy(dtype=float) for name in wide.columns)
    keys = list(zip(*(wide.index.get_level_values(name) for name in clusters)))
    estimate = paired.estimate_ratio(own, other, keys)
    runs = wide.index.get_level_values("run").nunique() if "run" in wide.index.names else estimate.runs
    judged = replace(estimate, runs=min(estimate.runs, runs))
    failed = np.isinf(own), np.isinf(other)
    both = int((failed[0] & failed[1]).sum())
    return Result(
        pairs=len(wide), clusters=estimate.runs, own_failed=int(failed[0].sum()), other_failed=int(failed[1].sum()),
        both_failed=both, unpaired=unpaired, won=int((own < other).sum()), lost=int((own > other).sum()),
        tied=int((own == other).sum()) - both, ratio=estimate.median, low=estimate.low, high=estimate.high,
        verdict=paired.verdict(judged, rule.least, rule.margin_pct), enough=judged.runs >= rule.least,
    )  # fmt: skip


def sign_flip_p(wide: pd.DataFrame) -> float:
    """p of the mean difference when each pair's sign is drawn; NaN where an error is infinite."""
    own, other = (wide[name].to_numpy(dtype=float) for name in wide.columns)
    if len(own) < 2 or not np.isfinite([own, other]).all():
        return float("nan")
    test = stats.permutation_test(
        (own, other), lambda a, b: np.mean(a - b), permutation_type="samples", n_resamples=9999, random_state=1
    )
    return float(test.pvalue)


def group(lines: pd.DataFrame, columns: list[str]) -> list[tuple[str, pd.DataFrame]]:
    """The lines by the values of some columns, which the text joins; all together without columns."""
    if not columns:
        return [("", lines)]
    grouped = lines.groupby(columns[0] if len(columns) == 1 else columns, sort=False)
    return [(", ".join(map(str, key if isinstance(key, tuple) else (key,))), own) for key, own in grouped]


def mark_near_duplicates(lines: pd.DataFrame, table: str) -> pd.DataFrame:
    """The lines with a column `cluster`: the scene, or the first of those that show the same."""
    groups = config.load_experiment(table).near_duplicates
    first = {scene: group[0] for group in groups for scene in group}
    return lines.assign(cluster=[first.get(scene, scene) for scene in lines["scene"]])


def make_table(spec: ReportPairs, lines: pd.DataFrame, rule: Rule) -> pd.DataFrame:
    """A line for each pair of methods in each group, once for each notion of what is independent."""
    if "scene" in lines.columns:
        lines = mark_near_duplicates(lines, spec.name)
    rows = []
    for where, own_lines in group(lines, spec.groups):
        for name, clusters in spec.clusters.items():
            errors = side_by_side(own_lines, spec.method, spec.quantity, [*spec.pairs, *clusters])
            for own, other in itertools.combinations(own_lines[spec.method].unique(), 2):
                result = compare(*pair_up(errors, own, other), clusters, rule)
                key = {"experiment": spec.name, "where": where, "clusters_are": name, "own": own, "other": other}
                rows.append({**key, **asdict(result)})
    return pd.DataFrame(rows, columns=ROW)
