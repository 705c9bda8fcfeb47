"""Claims judged on made-up tables: what holds, what fails, and what decides nothing."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml

from sgf_paper import claims, comparison, config, pairs, paths
from sgf_paper.claims import FAILS, FEW, HOLDS, MISSING, OPEN, ClaimError, Outcome
from sgf_paper.pairs import Rule
from sgf_paper.report_config import Claim, Interval, Ordering, Paired, ReportPairs, Value, load_claims
from sgf_paper.strict_yaml import ConfigError

RULE = Rule(least=10, margin_pct=5)
CLAIMS = load_claims()
EVERY = [*CLAIMS.claims, *CLAIMS.slips, *CLAIMS.new]
ORDER = Ordering("t", "cost", "error", "sgf", ["sad", "pm"], groups=["frame"])
PAIR = Paired("t", "cost", "error", "sgf", ["sad"], pairs=["scene"], clusters=["scene"])
RUNS = Paired(
    "t", "column", "ate", "sgf", ["photo"], pairs=["sequence", "run"], clusters=["sequence", "first_frame"]
)


def outcomes(check, frame, rule=RULE):
    return claims.judge_check(check, {"t": frame}.get, rule)


def states(check, frame):
    return [outcome.state for outcome in outcomes(check, frame)]


def costs(**values):
    return pd.DataFrame([{"frame": 1, "cost": cost, "error": error, "scenes": 3} for cost, error in values.items()])


def scenes(sgf, sad):
    """Errors of two costs on scenes a, b, c, ..."""
    return pd.DataFrame([
        {"scene": chr(ord("a") + index), "cost": cost, "error": error}
        for cost, errors in (("sgf", sgf), ("sad", sad))
        for index, error in enumerate(errors)
    ])  # fmt: skip


def runs(own, other):
    """Errors of two columns in runs of one sequence, each from a frame of its own."""
    return pd.DataFrame([
        {"sequence": "MH", "run": run, "first_frame": run, "column": column, "ate": error}
        for column, errors in (("sgf", own), ("photo", other))
        for run, error in enumerate(errors)
    ])  # fmt: skip


@pytest.mark.parametrize(
    "frame, state",
    [
        (costs(sgf=1.0, sad=2.0, pm=1.5), HOLDS),
        (costs(sgf=1.6, sad=2.0, pm=1.5), FAILS),
        (costs(sgf=1.5, sad=2.0, pm=1.5), OPEN),  # level is not ahead
        (costs(sgf=1.0, sad=math.inf, pm=math.inf), HOLDS),  # the others fail
        (costs(sgf=math.inf, sad=2.0, pm=math.inf), FAILS),
        (costs(sgf=math.inf, sad=math.inf, pm=math.inf), OPEN),
        (costs(sad=2.0, pm=1.5), MISSING),
        (costs(sgf=math.nan, sad=2.0, pm=1.5), MISSING),
        (costs(sgf=1.0), MISSING),
        (costs(sgf=1.0, sad=2.0, pm=1.5, census=0.1), HOLDS),  # which is not among them
    ],
)
def test_an_ordering_needs_the_least_value(frame, state):
    assert states(ORDER, frame) == [state]


def test_an_ordering_names_who_is_next_and_who_has_no_value():
    outcome = outcomes(ORDER, costs(sgf=1.0, sad=2.0))[0]
    assert outcome.number == "sgf 1, sad 2 (no value: pm)" and outcome.where == "1"


def test_the_greatest_value_can_be_asked_for():
    highest = replace(ORDER, highest=True)
    assert states(highest, costs(sgf=3.0, sad=2.0)) == [HOLDS]
    assert states(highest, costs(sgf=1.0, sad=2.0)) == [FAILS]


def test_means_of_few_scenes_order_nothing():
    assert states(replace(ORDER, count="scenes"), costs(sgf=1.0, sad=2.0)) == [FEW]


def test_each_group_is_judged_by_itself_and_has_one_line_a_method():
    two = pd.concat([costs(sgf=1.0, sad=2.0), costs(sgf=3.0, sad=2.0).assign(frame=2)])
    assert states(ORDER, two) == [HOLDS, FAILS]
    with pytest.raises(ClaimError, match="t has several lines of a method"):
        outcomes(replace(ORDER, groups=[]), two)


def test_pairs_decide_where_there_are_enough():
    sad = np.linspace(1, 3, 12)
    assert states(PAIR, scenes(0.5 * sad, sad)) == [HOLDS]
    assert states(PAIR, scenes(2.0 * sad, sad)) == [FAILS]
    assert states(PAIR, scenes(1.01 * sad, sad)) == [FAILS]  # equal is not better
    assert states(PAIR, scenes(sad * np.tile([0.5, 2], 6), sad)) == [OPEN]
    assert states(PAIR, scenes(0.5 * sad[:9], sad[:9])) == [FEW]
    number = outcomes(PAIR, scenes(0.5 * sad, sad))[0].number
    assert number.startswith("0.50 [0.50, 0.50], 12 won, 0 lost, 0 tied of 12: better")


def test_near_duplicates_are_one_pair():
    sad = np.linspace(1, 3, 10)
    frame = scenes(0.5 * sad, sad).replace({"scene": {"a": "Piano", "b": "PianoL"}})
    twins = replace(PAIR, near_duplicates_of="table1", clusters=["cluster"])
    assert states(PAIR, frame) == [HOLDS]
    assert states(twins, frame) == [FEW]


def test_a_run_that_fails_counts_against_its_method():
    fine, failed = [1.0] * 12, [math.inf] * 12
    assert states(RUNS, runs(failed, fine)) == [FAILS]
    assert states(RUNS, runs(fine, failed)) == [HOLDS]
    assert "failed 0 and 12" in outcomes(RUNS, runs(fine, failed))[0].number


def test_pairs_that_fail_twice_say_nothing_and_are_counted():
    failed = [math.inf] * 4
    result = outcomes(RUNS, runs([0.5] * 8 + failed, [1.0] * 8 + failed))[0]
    assert result.state == FEW and "8 won, 0 lost, 0 tied of 12, failed 4 and 4" in result.number
    assert states(RUNS, runs([math.inf] * 12, [math.inf] * 12)) == [FEW]


def test_failures_and_lines_without_partner_are_in_the_table_of_pairs():
    spec = ReportPairs(
        "odometry", "t", "T", "column", "ate", ["sequence"], ["sequence", "run"], {"runs": ["sequence", "first_frame"]}
    )  # fmt: skip
    line = pairs.make_table(spec, runs([0.5, math.inf, math.inf, 2.0], [1.0, math.inf, 1.0]), RULE).iloc[0]
    counts = ["pairs", "own_failed", "other_failed", "both_failed", "unpaired", "won", "lost", "tied"]
    assert list(line[counts]) == [3, 2, 1, 1, 1, 1, 1, 0]


def test_runs_of_few_first_frames_are_few_pairs():
    frame = runs([0.5] * 20, [1.0] * 20)
    frame["first_frame"] %= 5
    assert states(RUNS, frame) == [FEW]


def test_lines_without_a_partner_are_left_out_and_counted():
    wide = pairs.side_by_side(scenes([1.0, 2.0, 3.0], [2.0]), "cost", "error", ["scene"])
    both, unpaired = pairs.pair_up(wide, "sgf", "sad")
    assert len(both) == 1 and unpaired == 2
    assert states(replace(PAIR, among=["census"]), scenes([1.0], [2.0])) == [MISSING]


@pytest.mark.parametrize(
    "low, high, count, state",
    [
        (1, 3, 12, HOLDS),
        (-3, -1, 12, FAILS),
        (-3, 0, 12, FAILS),
        (-1, 3, 12, OPEN),
        (1, 3, 9, FEW),
        (math.nan, math.nan, 12, MISSING),
    ],
)
def test_an_interval_lies_above_or_below(low, high, count, state):
    frame = pd.DataFrame([{"gain": 2, "low": low, "high": high, "pairs": count}])
    check = Interval("t", "gain", "low", "high", ["pairs"], above=0)
    assert states(check, frame) == [state]
    mirrored = pd.DataFrame([{"gain": -2, "low": -high, "high": -low, "pairs": count}])
    assert states(replace(check, above=None, below=0), mirrored) == [state]


@pytest.mark.parametrize("runs, state", [(10, HOLDS), (3, FEW)])
def test_an_interval_takes_enough_runs_however_many_pairs_they_make(runs, state):
    frame = pd.DataFrame([{"gain": 2, "low": 1, "high": 3, "pairs": 4 * runs, "runs": runs}])
    found = outcomes(Interval("t", "gain", "low", "high", ["pairs", "runs"], above=0), frame)[0]
    assert found.state == state and found.number == f"2 [1, 3], pairs: {4 * runs}, runs: {runs}"


def test_a_claim_on_successes_takes_ten_runs():
    frame = pd.read_csv(paths.REFERENCE / "table3_dso_compared.csv")
    claim = next(claim for claim in EVERY if claim.id == "ngv_motion_local_light")
    for runs, verdict in ((13, claims.REPRODUCED), (3, claims.UNDECIDED)):
        assert claims.judge_checks(claim.checks, lambda _: frame.assign(runs=runs), RULE).verdict == verdict


def test_an_outcome_names_the_lines_it_rests_on():
    frame = pd.concat([costs(census=9.0, sgf=1.0, sad=2.0), costs(sgf=3.0, pm=2.0).assign(frame=2)], ignore_index=True)
    assert [outcome.lines for outcome in outcomes(ORDER, frame)] == [(3, 4), (5, 6)]
    assert [outcome.lines for outcome in outcomes(PAIR, scenes([1.0, 2.0], [2.0, 3.0]))] == [(2, 3, 4, 5)]
    assert replace(Outcome("", HOLDS, "", "t"), lines=(2, 3, 4, 7, 9, 10)).lines_text == "2–4, 7, 9–10"


def test_values_have_limits():
    frame = pd.DataFrame({"system": ["a", "a", "b", "c"], "ms": [10, 20, 60, math.nan]})
    check = Value("t", "ms", groups=["system"], at_most=50)
    assert states(check, frame) == [HOLDS, FAILS, MISSING]
    assert outcomes(check, frame)[0].number == "ms 10 to 20"
    assert states(replace(check, at_most=None, at_least=30), frame) == [FAILS, HOLDS, MISSING]


def test_what_is_not_there_is_named():
    assert outcomes(ORDER, None)[0].number == "table t was not made"
    chosen = replace(ORDER, where={"frame": [7, 8]})
    assert outcomes(chosen, costs(sgf=1.0, sad=2.0))[0].number == "table t has no such line: frame [7, 8]"
    with pytest.raises(ClaimError, match="table t has no column colour"):
        outcomes(replace(ORDER, where={"colour": 1}), costs(sgf=1.0))
    with pytest.raises(ClaimError, match="table t has no column bad2_pct"):
        outcomes(replace(ORDER, quantity="bad2_pct"), costs(sgf=1.0))


@pytest.mark.parametrize(
    "found, verdict",
    [
        ([HOLDS, HOLDS], claims.REPRODUCED),
        ([HOLDS, FEW, MISSING], claims.REPRODUCED),
        ([HOLDS, OPEN], claims.PARTLY),
        ([HOLDS, FAILS], claims.PARTLY),
        ([FAILS, OPEN], claims.NOT),
        ([FAILS, FEW], claims.NOT),
        ([OPEN, OPEN], claims.UNDECIDED),
        ([FEW, MISSING], claims.UNDECIDED),
        ([MISSING], claims.NOT_MEASURED),
        ([], claims.NOT_MEASURED),
    ],
)
def test_outcomes_make_a_verdict(found, verdict):
    assert claims.make_verdict([Outcome("", state, "", "t") for state in found]) == verdict


def test_the_source_that_decides_more_has_the_verdict():
    claim = Claim("c", "Table I", "says", [PAIR])
    sad = np.linspace(1, 3, 12)
    few, many = {"t": scenes(2 * sad[:2], sad[:2])}.get, {"t": scenes(0.5 * sad, sad)}.get
    finding = claims.judge(claim, {"this run": few, "reference run": many}, {}.get, RULE)
    assert (finding.judged.verdict, finding.decided_by) == (claims.REPRODUCED, "reference run")
    assert finding.sources["this run"].reason == "fewer than 10 independent pairs"
    level = claims.judge(claim, {"this run": many, "reference run": many}, {}.get, RULE)
    assert level.decided_by == "this run"
    nothing = claims.judge(claim, {"this run": {}.get}, {}.get, RULE)
    assert nothing.judged.verdict == claims.NOT_MEASURED and nothing.judged.reason == "table t was not made"


def test_all_pairs_of_methods_are_compared_over_each_kind_of_cluster():
    spec = ReportPairs(
        "odometry", "t", "T", "column", "ate", ["sequence"], ["sequence", "run"],
        {"runs": ["sequence", "first_frame"], "sequences": ["sequence"]},
    )  # fmt: skip
    frame = pd.concat([runs([0.5] * 12, [1.0] * 11 + [math.inf]), runs([2.0] * 12, []).replace("sgf", "ngv")])
    table = pairs.make_table(spec, frame, RULE)
    assert [*zip(table["own"], table["other"], table["clusters_are"], table["verdict"])] == [
        ("sgf", "photo", "runs", "better"),
        ("sgf", "ngv", "runs", "better"),
        ("photo", "ngv", "runs", "better"),
        ("sgf", "photo", "sequences", "undecided"),
        ("sgf", "ngv", "sequences", "undecided"),
        ("photo", "ngv", "sequences", "undecided"),
    ]
    assert list(table["other_failed"][:2]) == [1, 0] and list(table["won"][:3]) == [12, 12, 11]


# --- the project's own claims ----------------------------------------------------------------------


def test_every_statement_has_a_check_or_says_why_not():
    assert all(claim.checks or claim.published or claim.note for claim in EVERY)
    assert all(claim.allows for claim in CLAIMS.claims), "what the published rows allow is said of every claim"


@pytest.mark.parametrize("claim", EVERY, ids=[claim.id for claim in EVERY])
def test_checks_fit_the_tables_they_read(claim):
    finding = claims.judge(claim, {"reference": claims.Tables(paths.REFERENCE)}, comparison.PublishedRows(), RULE)
    if finding.published:
        assert MISSING not in {outcome.state for outcome in finding.published.outcomes}
    for check in claim.checks:
        name = next(path.stem for path in paths.EXPERIMENTS.glob("*.yaml") if is_made_by(check.table, path.stem))
        assert config.load_experiment(name).kind != "report"


def is_made_by(table, experiment):
    ends = ("", "_scenes", "_runs", "_compared", "_minima", "_equal", "_timings")
    return table in [experiment + end for end in ends]


def published_outcomes(name):
    claim = next(claim for claim in EVERY if claim.id == name)
    return claims.judge_checks(claim.published, comparison.PublishedRows(), RULE).outcomes


def test_published_rows_do_not_separate_the_third_claim():
    basalt = published_outcomes("table3_sgf3_best")[0]
    assert basalt.state == OPEN and "4 won, 5 lost, 1 tied of 10" in basalt.number and "p = 0.68" in basalt.number
    dso = published_outcomes("table3_dso_error")[0]
    assert dso.state == OPEN and "5 won, 5 lost" in dso.number and "p = 0.52" in dso.number


def test_published_rows_say_of_bad_pixels_in_mesh_stereo_that_the_original_has_fewer():
    assert [outcome.state for outcome in published_outcomes("table1_bad")] == [HOLDS] * 4 + [FAILS]
    assert [outcome.state for outcome in published_outcomes("fig1_sgf_least")] == [HOLDS, OPEN]


@pytest.mark.parametrize(
    "change, message",
    [
        ({"checks": [{"kind": "guess"}]}, r"claims\[0\].checks\[0\]: kind is 'guess'; known: ordering, paired"),
        ({"checks": [{"kind": "value", "table": "t"}]}, r"claims\[0\].checks\[0\]: key 'quantity' is missing"),
        ({"published": [{"kind": ["value"]}]}, r"claims\[0\].published\[0\].kind: expected str, found \['value'\]"),
        ({"checks": ["value"]}, r"claims\[0\].checks\[0\]: expected a map, found 'value'"),
        ({"colour": "red"}, "unknown key 'colour'"),
    ],
)
def test_mistakes_in_claims_are_named(tmp_path, change, message):
    claim = {"id": "c", "place": "p", "says": "s", "checks": [], **change}
    path = tmp_path / "claims.yaml"
    path.write_text(yaml.safe_dump({"claims": [claim], "slips": [], "new": []}))
    with pytest.raises(ConfigError, match=message):
        load_claims(path)


def test_a_name_stands_for_one_statement(tmp_path):
    claim = {"id": "c", "place": "p", "says": "s", "checks": []}
    path = tmp_path / "claims.yaml"
    path.write_text(yaml.safe_dump({"claims": [claim], "slips": [], "new": [claim]}))
    with pytest.raises(ConfigError, match=r"\['c'\] is there twice"):
        load_claims(path)
