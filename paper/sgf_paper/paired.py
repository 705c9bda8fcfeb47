"""Comparison of runs that were made under the same circumstances, one pair each.

An error is infinite where a run is lost. Intervals hold the median or the mean at 95 % (Efron's
percentile bootstrap, 1979); of n runs they hold nothing that n runs do not show, hence a least number
of them for a verdict.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

RESAMPLES = 2000
SEED = 1
NAN = float("nan")
ENDS = [0.025, 0.975]  # of intervals


@dataclass(frozen=True)
class Estimate:
    """A median over runs and its interval; NaN without runs."""

    median: float
    low: float
    high: float
    runs: int  # independent ones: clusters


def estimate_median(of_runs: Sequence[float], clusters: Sequence[Hashable] | None = None) -> Estimate:
    """The median of the values that are numbers; infinite ones count.

    @param clusters of each value: those of one cluster see the same images, and are drawn together. None: all differ.
    """
    values = np.asarray(of_runs, dtype=float)
    known = ~np.isnan(values)
    if not known.any():
        return Estimate(NAN, NAN, NAN, 0)
    values = values[known]
    codes, left = pd.factorize(pd.Series(range(len(known)) if clusters is None else list(clusters))[known])
    order = np.argsort(values)
    drawn = _resample(len(left))
    times = np.stack([(drawn == cluster).sum(axis=1) for cluster in range(len(left))], axis=1)
    low, high = quantiles(_weighted_medians(values[order], times[:, codes[order]]), ENDS)
    middle = _weighted_medians(values[order], np.ones((1, values.size), dtype=int))
    return Estimate(float(middle[0]), low, high, len(left))


def _resample(count: int) -> np.ndarray:
    """Indices of what is drawn with replacement, a line per resampling."""
    return np.random.default_rng(SEED).integers(count, size=(RESAMPLES, count))


def quantiles(values: Sequence[float], shares: Sequence[float]) -> list[float]:
    """Values that such shares do not exceed; infinite ones count."""
    return [float(value) for value in np.quantile(values, shares, method="inverted_cdf")]


def ratios(errors: Sequence[float], of_others: Sequence[float]) -> np.ndarray:
    """Errors over those of the other runs, in the same order; NaN where both are lost."""
    with np.errstate(invalid="ignore"):
        return np.divide(errors, of_others)


def verdict(ratio: Estimate, least_runs: int, margin_pct: float) -> str:
    """What an interval of ratios says: `better` is less than 1.

    @param margin_pct ratios nearer to 1 (by factor) are `equal`.
    """
    if ratio.runs < least_runs:
        return "undecided"
    margin = 1 + margin_pct / 100
    if 1 / margin <= ratio.low and ratio.high <= margin:
        return "equal"
    if ratio.high < 1:
        return "better"
    return "worse" if ratio.low > 1 else "undecided"


@dataclass(frozen=True)
class SuccessDifference:
    """Which runs of a column and of its baseline succeed, pair by pair."""

    pairs: int
    both: int
    only_own: int
    only_baseline: int
    difference_pct: float  # of the shares of successes, own minus the baseline's
    low_pct: float
    high_pct: float
    p: float  # of McNemar's exact test of the pairs in which one succeeds


def compare_success(
    own: Sequence[bool], of_baseline: Sequence[bool], clusters: Sequence[Hashable]
) -> SuccessDifference:
    """Compares successes given in the same order.

    @param clusters of each pair: pairs of one cluster see the same images, and are drawn together.
    """
    a, b = np.asarray(own, dtype=bool), np.asarray(of_baseline, dtype=bool)
    only_own, only_baseline = int((a & ~b).sum()), int((b & ~a).sum())
    differing = only_own + only_baseline
    tail = sum(math.comb(differing, k) for k in range(min(only_own, only_baseline) + 1))
    p = min(1.0, 2 * tail / 2**differing)
    of_pair = pd.DataFrame({"gain": a.astype(int) - b, "pairs": 1})
    of_cluster = of_pair.groupby(pd.Series(list(clusters))).sum().to_numpy()
    gain, pairs = of_cluster[_resample(len(of_cluster))].sum(axis=1).T
    low, high = quantiles(100 * gain / pairs, ENDS)
    difference_pct = 100 * (only_own - only_baseline) / a.size
    return SuccessDifference(
        a.size, int((a & b).sum()), only_own, only_baseline, difference_pct, low, high, p
    )


def estimate_ratio(
    own: Sequence[float], of_baseline: Sequence[float], clusters: Sequence[Hashable]
) -> Estimate:
    """The median ratio of errors, pair by pair; pairs of runs that are both lost have nothing to say.

    A run that alone is lost is infinitely worse: that counts in the median as any ratio on its side of it.
    Medians are taken of logarithms, so that the two may change places.
    @param clusters as for compare_success(); the estimate's `runs` are those that are left.
    """
    with np.errstate(divide="ignore"):
        of_logs = estimate_median(np.log(ratios(own, of_baseline)), clusters)
    median, low, high = (float(np.exp(value)) for value in (of_logs.median, of_logs.low, of_logs.high))
    return Estimate(median, low, high, of_logs.runs)


def _weighted_medians(ordered: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The median of values, each taken as often as a line of `counts` says; 0 between −∞ and ∞."""
    up_to = 2 * counts.cumsum(axis=1)
    total = counts.sum(axis=1, keepdims=True)
    lower, upper = ordered[(up_to >= total).argmax(axis=1)], ordered[(up_to > total).argmax(axis=1)]
    with np.errstate(invalid="ignore"):
        middle = (lower + upper) / 2
    return np.where(np.isnan(middle), 0, middle)
