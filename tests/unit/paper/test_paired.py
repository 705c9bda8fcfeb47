"""Medians over runs of which some are lost, their ratios, and what may be said of them."""

import math

import numpy as np
import pytest

from sgf_paper.paired import (
    Estimate, compare_success, estimate_median, estimate_ratio, quantiles, ratios, verdict,
)  # fmt: skip

INF, NAN = math.inf, math.nan


def test_the_median_counts_lost_runs_and_leaves_out_what_is_no_number():
    assert estimate_median([3.0, 1.0, NAN, 2.0]).median == 2
    assert estimate_median([1.0, 2.0, INF]).median == 2
    assert estimate_median([1.0, INF]).median == estimate_median([INF, INF]).median == INF
    assert estimate_median([3.0, NAN]).runs == 1
    nothing = estimate_median([NAN])
    assert nothing.runs == 0 and math.isnan(nothing.median) and math.isnan(nothing.low)


def test_the_interval_holds_the_middle_of_many_runs_and_all_of_few():
    few = estimate_median([5.0, 1.0, 9.0])
    assert (few.low, few.high) == (1, 9)
    many = estimate_median(np.arange(101.0))
    # 101 / 2 +- 1.96 * sqrt(101) / 2 by the normal approximation
    assert many.low == pytest.approx(40, abs=2) and many.high == pytest.approx(60, abs=2)
    assert estimate_median([1.0] * 9 + [INF]) == Estimate(1, 1, 1, 10)
    assert estimate_median([1.0] * 6 + [INF] * 4).high == INF


def test_runs_of_one_cluster_are_drawn_together():
    values = np.arange(12.0)
    found = estimate_median([*values, *values], [*range(12), *range(12)])
    assert found == estimate_median(values), "the same runs twice say no more than once"
    assert found.runs == 12
    narrower = estimate_median([*values, *values])
    assert narrower.high - narrower.low < found.high - found.low
    assert estimate_median([1.0, 2.0, NAN], "aab").runs == 1


def test_ratios_have_nothing_to_say_where_both_are_lost():
    values = ratios([1.0, INF, 2.0, INF], [2.0, 1.0, INF, INF])
    assert list(values[:3]) == [0.5, INF, 0] and math.isnan(values[3])


@pytest.mark.parametrize(
    "low, high, runs, said",
    [
        (0.5, 0.9, 10, "better"),
        (0.5, 0.9, 9, "undecided"),
        (0.9, 1.01, 10, "undecided"),
        (1.1, INF, 10, "worse"),
        (0.96, 1.04, 10, "equal"),
        (0.96, 0.99, 10, "equal"),
        (0.94, 0.99, 10, "better"),
        (1.01, 1.06, 10, "worse"),
        (NAN, NAN, 0, "undecided"),
    ],
)
def test_a_verdict_takes_enough_runs_and_an_interval_on_one_side(low, high, runs, said):
    assert verdict(Estimate(1.0, low, high, runs), least_runs=10, margin_pct=5) == said


def test_quantiles_are_values_of_runs_and_hold_infinite_ones():
    assert quantiles([4.0, 1.0, INF, 2.0], [0.5, 0.75, 0.9]) == [2, 4, INF]


def test_success_is_compared_by_the_pairs_that_differ():
    own = [True] * 12 + [False] * 8
    baseline = [True] * 4 + [False] * 15 + [True]
    found = compare_success(own, baseline, range(20))
    assert (found.pairs, found.both, found.only_own, found.only_baseline) == (20, 4, 8, 1)
    assert found.difference_pct == pytest.approx(35)
    # two-sided binomial: 2 * (1 + 9) / 2^9
    assert found.p == pytest.approx(20 / 512)
    # 0.35 +- 1.96 * sqrt((9/20 - 0.35^2) / 20) by the normal approximation
    assert found.low_pct == pytest.approx(10, abs=5) and found.high_pct == pytest.approx(60, abs=5)


def test_pairs_that_see_the_same_images_are_drawn_together():
    own, baseline = [True] * 10 + [False] * 10, [False] * 20
    apart = compare_success(own, baseline, range(20))
    together = compare_success(own, baseline, [("a", k // 10) for k in range(20)])
    assert apart.difference_pct == together.difference_pct == 50
    assert 20 < apart.low_pct < apart.high_pct < 80
    assert (together.low_pct, together.high_pct) == (0, 100)


def test_pairs_that_never_differ_show_nothing():
    found = compare_success([True, False], [True, False], "ab")
    assert (found.p, found.difference_pct, found.low_pct, found.high_pct) == (1, 0, 0, 0)


def test_the_ratio_of_errors_is_the_middle_pair_whichever_way_round():
    own, baseline = [1.0, 2.0, INF, 6.0, INF], [2.0, 1.0, 5.0, 2.0, INF]
    found = estimate_ratio(own, baseline, "abcde")
    # ratios 1/2, 2, infinite and 3; the last pair is lost twice
    assert found.median == pytest.approx(math.sqrt(2 * 3)) and found.runs == 4
    assert (found.low, found.high) == (pytest.approx(0.5), INF)
    other = estimate_ratio(baseline, own, "abcde")
    assert other.median == pytest.approx(1 / found.median) and other.low == 0
    assert estimate_ratio([INF, 1.0], [1.0, INF], "ab").median == 1
    assert estimate_ratio([INF], [INF], "a").runs == 0


def test_the_interval_of_the_ratio_is_that_of_a_median_and_clusters_widen_it():
    baseline = np.full(101, 2.0)
    own = baseline * np.exp(np.arange(-50, 51) / 50)
    apart = estimate_ratio(own, baseline, range(101))
    # ranks 101 / 2 +- 1.96 * sqrt(101) / 2 by the normal approximation
    assert math.log(apart.high) == pytest.approx(0.2, abs=0.05) and apart.median == pytest.approx(1)
    assert math.log(apart.low) == pytest.approx(-0.2, abs=0.05)
    together = estimate_ratio(own, baseline, np.arange(101) // 20)
    assert together.runs == 6 and together.high > 1.5 * apart.high


def test_clusters_of_one_pair_each_give_the_interval_of_the_plain_bootstrap():
    ratio = np.exp(np.random.default_rng(1).normal(size=15))
    found, plain = estimate_ratio(ratio, np.ones(15), range(15)), estimate_median(ratio)
    assert (found.median, found.low, found.high) == pytest.approx((plain.median, plain.low, plain.high))
