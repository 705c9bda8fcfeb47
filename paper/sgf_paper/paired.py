"""Comparison of runs that were made under the same circumstances, one pair each.

An error is infinite where a run is lost. Intervals hold the median at 95 % (Efron's percentile
bootstrap, 1979); of n runs they hold nothing that n runs do not show, hence a least number of them for
a verdict.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

RESAMPLES = 2000
SEED = 1
NAN = float("nan")


@dataclass(frozen=True)
class Estimate:
    """A median over runs and its interval; NaN without runs."""

    median: float
    low: float
    high: float
    runs: int


def estimate_median(of_runs: Sequence[float]) -> Estimate:
    """The median of the values that are numbers; infinite ones count."""
    values = np.asarray(of_runs, dtype=float)
    values = values[~np.isnan(values)]
    if values.size == 0:
        return Estimate(NAN, NAN, NAN, 0)
    chosen = np.random.default_rng(SEED).integers(values.size, size=(RESAMPLES, values.size))
    medians = np.median(values[chosen], axis=1)
    low, high = np.quantile(medians, [0.025, 0.975], method="inverted_cdf")  # which copes with infinity
    return Estimate(float(np.median(values)), float(low), float(high), values.size)


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
