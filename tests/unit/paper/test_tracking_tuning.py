"""Options found on one fold and scored on the other: folds, failures, going on, and what is taken."""

import json
import math
from pathlib import Path

import pytest
import yaml

from sgf_paper import config, paths, summary, tracking_tuning, tuning_report
from sgf_paper.strict_yaml import ConfigError, read_yaml
from sgf_paper.tracking_config import SearchRange, load_tuned
from sgf_paper.tracking_tuning import Tracker, TuningError

TABLE = yaml.safe_load((paths.EXPERIMENTS / "table3_vio.yaml").read_text())
NODE = yaml.safe_load((paths.EXPERIMENTS / "tune.yaml").read_text())
TINY = yaml.safe_load((paths.EXPERIMENTS / "tune_tiny.yaml").read_text())
REVIEWED = sorted(path.stem for path in (paths.EXPERIMENTS / "tuned").glob("*.yaml"))
DEFAULTS = {"flow.max_backward_px": 0.5, "flow.max_iterations": 5}
NOTED = """options:
  flow: {max_backward_px: 0.5, max_iterations: 5}
build: {version: 1.2.3, revision: abc}
"""
# Off by 1 % of the path where the way back is allowed 1 px, and by the more the farther from that. Told to fail or
# to lose frames by files beside it.
PROGRAM = """#!/usr/bin/python3
import json, math, pathlib, sys
here = pathlib.Path(__file__).parent
flags = dict(zip(sys.argv[2::2], sys.argv[3::2]))
if (here / "fail").exists():
    sys.exit("no such option")
backward = float(flags.get("--flow.max-backward-px", 0.5))
out = pathlib.Path(flags["-o"])
out.mkdir(parents=True, exist_ok=True)
(out / "trajectory.txt").write_text(str(0.01 + 0.002 * abs(math.log(backward))))
posed = 50 if (here / "lose").exists() else 80
(out / "summary.json").write_text(json.dumps({"frames": 80, "posed": posed, "clipped_share": 0}))
(out / "options.yaml").write_text((here / "noted").read_text())
"""
# Errors are what stands in the trajectory; the path is 1 m. Success by scale as a file says.
SCORER = """#!/usr/bin/python3
import json, pathlib, sys
names = json.loads(pathlib.Path(__file__).with_name("names").read_text())
error = float(pathlib.Path(sys.argv[2]).read_text())
success = not pathlib.Path(__file__).with_name("unscaled").exists()
scores = {name: success if name.startswith("success") else error for name in names} | {"path_m": 1}
out = pathlib.Path(sys.argv[sys.argv.index("--out") + 1])
out.write_text(json.dumps({"poses": 80, **scores}))
"""


@pytest.fixture
def write(experiments):
    """Writes the experiment, changed, beside the table; returns what is read of it."""
    (experiments / "table3_vio.yaml").write_text(yaml.safe_dump(TABLE, sort_keys=False))

    def write(name="tune", base=NODE, **change):
        (experiments / f"{name}.yaml").write_text(yaml.safe_dump({**base, **change}, sort_keys=False))
        return config.load_experiment(name)

    return write


@pytest.fixture
def tuning(write):
    """Two options, and few runs."""
    space = {name: NODE["space"][name] for name in DEFAULTS}
    return write(space=space, budget={"trials": 12, "runs": 1, "held_out_runs": 2, "frames": 80})


@pytest.fixture
def tracker(tuning, tmp_path):
    """Stand-ins for the programs, and sequences of which there is the list of files alone."""
    names = ["ate_rmse_m", "ate_median_m", "ate_max_m", "scale_error_median_m", "scale_error_max_m"]
    (tmp_path / "names").write_text(json.dumps([*names, "success_by_scale", "success_by_ate"]))
    (tmp_path / "noted").write_text(NOTED)
    for name, text in (("sgf_vio", PROGRAM), ("sgf_eval", SCORER)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    for name in sum((tuning.rendered(fold) for fold in (0, 1)), []):
        (tmp_path / "suite" / name).mkdir(parents=True)
        (tmp_path / "suite" / name / "manifest.yaml").write_text(name)
    return Tracker(tuning, "sgf3", tmp_path / "sgf_vio", tmp_path / "sgf_eval", tmp_path / "suite")


@pytest.fixture
def document(tracker, tmp_path, monkeypatch):
    """What is written of a column whose runs are off by `error_of`; held out are other runs than tuned on."""
    runs = []

    def error_pct(tracker, sequence, condition, run, options):
        runs.append(run)
        return error_of(options)

    monkeypatch.setattr(Tracker, "error_pct", error_pct)
    written = tracking_tuning.tune(tracker, tmp_path / "study.db")
    assert [runs.count(run) for run in range(4)] == [2 * 12 * 4, 2 * 2 * 4, 2 * 2 * 4, 0]
    return written


def error_of(options):
    """Of PROGRAM, in % of the path."""
    return 1 + 0.2 * abs(math.log(options["flow.max_backward_px"]))


@pytest.mark.parametrize(
    "change, message",
    [
        ({"folds": [NODE["folds"][0], NODE["folds"][1][1:]]}, "each sequence of table3_vio has to be in one"),
        ({"folds": [NODE["folds"][0], NODE["folds"][1] + ["MH_01_easy"]]}, "has to be in one of two folds"),
        ({"folds": [sum(NODE["folds"], []), []]}, "folds: each needs a rendered sequence"),
        ({"conditions": ["fog"]}, r"conditions: table3_vio has no \['fog'\]"),
        ({"columns": ["sbd"]}, r"columns: table3_vio has no \['sbd'\]"),
        ({"space": {"a": {"low": 2, "high": 1}}}, "space.a: no range from 2 to 1"),
        ({"space": {"a": {"low": 0, "high": 1, "log": True}}}, "space.a: no range from 0 to 1"),
        ({"budget": {**NODE["budget"], "trials": 0}}, "budget: trials is 0; it has to be positive"),
        ({"space": {"a": {"low": "1e-3", "high": 1}}}, "space.a.low: expected float, found '1e-3'"),
        ({"table": 3}, "table: expected str, found 3"),
        ({"table": "tune"}, "table: tune is no trajectory_table"),
    ],
)
def test_mistakes_are_named(write, change, message):
    with pytest.raises(ConfigError, match=message):
        write(**change)


def test_the_tiny_budget_is_another_experiment_on_the_same_ranges(write):
    full, tiny = write(), write("tune_tiny", TINY)
    assert full.by_name_only and not tiny.by_name_only
    assert full.folder != tiny.folder and full.space == tiny.space and full.folds == tiny.folds
    assert full.columns == list(TABLE["columns"]) and set(tiny.columns) < set(full.columns)
    assert tiny.files == ["tune_tiny", "tune", "table3_vio"] and full.files == ["tune", "table3_vio"]


def test_no_run_begins_or_is_lit_like_one_of_the_table(tuning):
    def start(words):
        flags = dict(zip(words[::2], words[1::2]))
        return int(flags["--from"]), int(flags["--change.seed"])

    table, folder = tuning.table, Path("MH_01_easy")
    own = [start(tuning.flags("MH_01_easy", folder, "light", "sgf3", run, {})) for run in range(15)]
    theirs = [start(table.flags("MH_01_easy", folder, False, run, "light", "sgf3")) for run in range(100)]
    for tried, shown in zip(zip(*own), zip(*theirs)):
        assert set(tried).isdisjoint(shown) and len(set(tried)) == 15


def test_flags_are_the_columns_with_what_is_tried_and_the_condition(tuning):
    words = tuning.flags("MH_01_easy", Path("MH_01_easy"), "light", "sgf3", 0, {"keyframe_share": 0.6})
    flags = dict(zip(words[::2], words[1::2]))
    assert (flags["--flow.residual"], flags["--keyframe-share"], flags["--frames"]) == ("sgf3", "0.6", "80")
    assert (flags["--change.gamma"], flags["--change.encode"]) == ("2.2", "false")


def test_a_run_that_fails_counts_as_the_worst_success(tracker, tmp_path):
    def error(backward):
        return tracker.error_pct("MH_01_easy", "light", 0, {"flow.max_backward_px": backward})

    assert error(1) == pytest.approx(1) and error(math.e**2) == pytest.approx(1.4)
    assert error(math.e**9) == 2, "above the limit of the ATE"
    (tmp_path / "unscaled").touch()
    assert error(1) == 2, "the paper's rule"
    (tmp_path / "unscaled").unlink()
    (tmp_path / "lose").touch()
    assert error(1) == 2, "poses for too few frames"
    (tmp_path / "fail").touch()
    with pytest.raises(TuningError, match="--flow.max-backward-px 1 .*\nno such option"):
        error(1)


def test_each_fold_is_scored_with_what_was_found_on_the_other(tracker, document):
    assert document["defaults"] == DEFAULTS and document["space"].keys() == DEFAULTS.keys()
    assert document["build"] == {"version": "1.2.3", "revision": "abc"}
    assert document["data"].keys() == {*tracker.tuning.rendered(0), *tracker.tuning.rendered(1)}
    for index, fold in enumerate(document["folds"]):
        assert fold["used_for"] == tracker.tuning.folds[index]
        assert fold["trained_on"] == tracker.tuning.rendered(1 - index)
        assert not set(fold["trained_on"]) & set(fold["used_for"])
        expected = round(error_of(fold["parameters"]), 4)
        assert fold["trial"] > 0 and expected < fold["training"]["default_pct"] == 1.1386
        assert fold["training"]["tuned_pct"] == fold["held_out"]["tuned"]["error_pct"] == expected
        assert fold["held_out"]["runs"] == 8 and fold["training"]["runs"] == 4
        assert fold["held_out"]["ratio"]["median"] == pytest.approx(expected / 1.1386, abs=1e-3)
        assert len(str(fold["parameters"]["flow.max_backward_px"])) <= 5, "as many digits as were run"


def test_runs_under_both_conditions_are_drawn_together(tracker, tmp_path, monkeypatch):
    def error_pct(tracker, sequence, condition, run, options):
        return {"undisturbed": 1, "light": error_of(options) ** 4}[condition]

    monkeypatch.setattr(Tracker, "error_pct", error_pct)
    for fold in tracking_tuning.tune(tracker, tmp_path / "study.db")["folds"]:
        ratio = fold["held_out"]["ratio"]
        assert ratio["low"] == ratio["median"] == ratio["high"] < 1, "every first frame gains the same"


def trials_of(tracker, storage, fold=0):
    study = tracking_tuning.open_study(storage, tracking_tuning.study_name(tracker, fold))
    return [(trial.params, trial.value) for trial in tracking_tuning.finished(study)]


def search(tracker, storage, value_of):
    study = tracking_tuning.open_study(storage, tracking_tuning.study_name(tracker, 0))
    return tracking_tuning.search(study, tracker.tuning, DEFAULTS, value_of)


@pytest.mark.parametrize("stop", [0, 1, 11])
def test_a_stopped_search_finds_what_it_would_have_found(tracker, tmp_path, stop):
    tried = []

    def value(options):
        tried.append(options)
        return abs(math.log(options["flow.max_backward_px"])) + options["flow.max_iterations"]

    def stopped(options):
        if len(tried) == stop:
            raise KeyboardInterrupt
        return value(options)

    search(tracker, tmp_path / "whole.db", value)
    whole, tried[:] = list(tried), []
    assert whole[0] == DEFAULTS and len(whole) == 12 == len({str(options) for options in whole})
    with pytest.raises(KeyboardInterrupt):
        search(tracker, tmp_path / "parts.db", stopped)
    search(tracker, tmp_path / "parts.db", value)
    assert tried == whole
    assert trials_of(tracker, tmp_path / "parts.db") == trials_of(tracker, tmp_path / "whole.db")
    search(tracker, tmp_path / "parts.db", stopped)
    assert len(tried) == 12, "all trials are done"


def test_options_are_in_the_order_of_the_space_whatever_the_database_has(tuning):
    tried = dict(sorted(DEFAULTS.items(), reverse=True))
    for options in (tried, dict(reversed(tried.items()))):
        assert list(tracking_tuning.rounded(tuning, options).items()) == [
            (name, DEFAULTS[name]) for name in tuning.space if name in DEFAULTS
        ]


def test_another_program_or_other_data_begin_anew(tracker, tmp_path):
    names = [tracking_tuning.study_name(tracker, 0)]
    for file in (tracker.program, tracker.scorer, tmp_path / "suite" / "MH_01_easy" / "manifest.yaml"):
        file.write_text(file.read_text() + "# another\n")
        names.append(tracking_tuning.study_name(tracker, 0))
    tracker.tuning.space["flow.max_backward_px"] = SearchRange(0.1, 9)
    names.append(tracking_tuning.study_name(tracker, 0))
    assert len(set(names)) == 5
    (tmp_path / "suite" / "MH_03_medium" / "manifest.yaml").write_text("another")
    assert tracking_tuning.study_name(tracker, 0) == names[-1], "a sequence of the other fold"


def test_an_option_that_the_program_does_not_have_is_named(tracker):
    with pytest.raises(ConfigError, match="tune: space: the program has no option flow.max_backward_px"):
        tracking_tuning.defaults_of(tracker.tuning, {"flow": {"max_iterations": 5}})
    with pytest.raises(ConfigError, match="space.flow.max_backward_px: the program's default, 9, is outside"):
        tracking_tuning.defaults_of(tracker.tuning, {"flow": {"max_backward_px": 9}})


@pytest.fixture
def tuned_table(experiments, document):
    """The table with what was found for a column, and the folder of that."""
    (experiments / "tuned").mkdir()
    for index, fold in enumerate(document["folds"]):
        fold["parameters"]["flow.max_iterations"] = 3 + index
    (experiments / "tuned" / "sgf3.yaml").write_text(yaml.safe_dump(document))
    (experiments / "table3_vio.yaml").write_text(yaml.safe_dump({**TABLE, "tuned": True}, sort_keys=False))
    return config.load_experiment("table3_vio"), document, experiments / "tuned"


def test_a_sequence_gets_what_was_found_without_it(tuned_table):
    table, document, _ = tuned_table
    for fold, names in enumerate(NODE["folds"]):
        for name in names:
            options = table.options(name, Path(name), "light", "sgf3")
            assert options == {"flow.residual": "sgf3", **document["folds"][fold]["parameters"]}
            assert options["flow.max_iterations"] == 3 + fold


def test_what_is_missing_or_of_something_else_is_an_error(tuned_table):
    table, document, folder = tuned_table
    with pytest.raises(ConfigError, match=r"tuned/ngv.yaml: is missing; `./reproduce.sh --only tune` makes"):
        table.options("MH_01_easy", Path(), "light", "ngv")
    with pytest.raises(ConfigError, match="holds options of sgf_vio, not of sgf_direct"):
        load_tuned("sgf3", "sgf_direct", "MH_01_easy")
    with pytest.raises(ConfigError, match="has no options found without V9"):
        load_tuned("sgf3", "sgf_vio", "V9")
    document["folds"][0]["trained_on"].append("MH_01_easy")
    (folder / "sgf3.yaml").write_text(yaml.safe_dump(document))
    with pytest.raises(ConfigError, match="has no options found without MH_01_easy"):
        load_tuned("sgf3", "sgf_vio", "MH_01_easy")


def test_columns_are_tuned_from_their_own_options(tuned_table):
    tuning = config.load_experiment("tune")
    assert tuning.table.options("MH_01_easy", Path(), "light", "sgf3") == {"flow.residual": "sgf3"}


def test_tables_show_both_folds_and_the_defaults(tuned_table, experiments, write):
    _, document, folder = tuned_table
    tuning = write(columns=["sgf3"], space={name: NODE["space"][name] for name in DEFAULTS})
    (experiments / "tables").mkdir()
    tuning_report.make_report("tune", folder, experiments / "tables")
    text = (experiments / "tables" / "tune.md").read_text()
    assert "| (default) | | 0 | | | | | | | | 0.5 | 5 |\n| sgf3 | MH_03_medium V1_02_medium |" in text
    said = [line.strip() for line in summary.stage_lines(tuning, experiments, 0)]
    assert said[0].endswith("tuned/*.yaml, tables/tune.md (.csv)")
    assert said[2].startswith("sgf3 tuned on MH_01_easy V1_03_difficult, error elsewhere, % of the path: 1.")
    assert said[2].count("by default 1.14; ratio 0.") == 1 and len(said) == 3


@pytest.mark.parametrize("column", REVIEWED)
def test_what_is_committed_is_of_the_experiment_as_it_is(column):
    document = read_yaml(paths.EXPERIMENTS / "tuned" / f"{column}.yaml")
    tuning = config.load_experiment("tune")
    assert document["column"] == column and document["program"] == tuning.table.program(column)
    assert [fold["used_for"] for fold in document["folds"]] == tuning.folds
    for index, fold in enumerate(document["folds"]):
        assert fold["trained_on"] == tuning.rendered(1 - index)
        assert fold["parameters"].keys() == tuning.space.keys()
        for name, span in tuning.space.items():
            assert span.low <= fold["parameters"][name] <= span.high
