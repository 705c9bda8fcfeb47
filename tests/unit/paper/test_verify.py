"""Repeating recorded runs: the draw, the folder they run in, and how files are compared."""

import hashlib
import json
import sys

import pytest

from sgf_paper import record, run, verify
from sgf_paper.verify import Recorded, Tolerance

NOW = {"code": {}, "inputs": {}, "packages": {"libc6": "2.36"}, "processor": {"model": "x"}, "build": {}}
WRITER = "import pathlib, sys; pathlib.Path('raw/a', sys.argv[2]).write_text(sys.argv[1])"
TUNED = "build: {{revision: {build}}}\nfolds:\n- parameters: {{sigma: {sigma}}}\n  training: {{tuned_pct: {error}}}\n"


def sha256(text):
    return hashlib.sha256(text.encode()).hexdigest()


@pytest.fixture
def results(tmp_path, monkeypatch):
    """Results where every run has been recorded under conditions NOW, which still hold."""
    monkeypatch.setattr(record, "conditions", lambda inputs: NOW)
    (tmp_path / "results").mkdir()
    return tmp_path / "results"


@pytest.fixture
def add(results):
    """Adds a run that wrote some text, and says now that it writes another."""

    def add(
        text="mean_px\n1.00\n", again=None, file="scores.csv", rule="scores", wall_s=1.0, folder="runs/a", state="done",
        **changed,
    ):  # fmt: skip
        (results / "raw" / "a").mkdir(parents=True, exist_ok=True)
        (results / "raw" / "a" / file).write_text(text)
        (results / "raw" / "a" / "beside").write_text("1")
        node = {"rule": rule, "command": [sys.executable, "-c", WRITER, again or text, file], **NOW, **changed}
        node |= {"outputs": {f"raw/a/{file}": sha256(text)}, "exit": {"state": state}}
        record.write_json(results / folder / "run.json", node)
        record.write_json(results / folder / "timing.json", {"wall_s": wall_s})

    return add


def outcome(results):
    (run,) = verify.find_recorded(results)
    return verify.verify_run(run, results)


def test_the_same_bits_agree_and_other_bits_do_not_under_the_same_conditions(results, add):
    add()
    assert outcome(results) == ("same bits", "")
    add(again="mean_px\n1.01\n")
    assert outcome(results) == ("DIFFERS", "other bits: raw/a/scores.csv")
    assert (results / "raw" / "a" / "scores.csv").read_text() == "mean_px\n1.00\n", "the results are not touched"


@pytest.mark.parametrize(
    "again, word, what",
    [
        ("mean_px\n1.01\n", "within tolerances", "other packages"),
        ("mean_px\n1.5\n", "DIFFERS", "raw/a/scores.csv: mean_px 1.5 in place of 1.00; other packages"),
        ("mean_px\nnan\n", "DIFFERS", "raw/a/scores.csv: mean_px nan in place of 1.00; other packages"),
        ("mean_px\n1\n1\n", "DIFFERS", "raw/a/scores.csv: 3 values in place of 2; other packages"),
    ],
)
def test_under_other_conditions_numbers_have_tolerances(results, add, again, word, what):
    add(again=again, packages={"libc6": "2.35"})
    assert outcome(results) == (word, what)


@pytest.mark.parametrize(
    "again, word, what",
    [
        ({"sigma": 2, "error": 0.5, "build": "b"}, "within tolerances", ""),
        ({"sigma": 2, "error": 0.51}, "within tolerances", ""),
        ({"sigma": 3, "error": 0.5}, "DIFFERS", "raw/a/sgf.yaml: folds.parameters.sigma 3 in place of 2; "),
        ({"sigma": 2, "error": 0.9}, "DIFFERS", "raw/a/sgf.yaml: folds.training.tuned_pct 0.9 in place of 0.5; "),
        ({"sigma": "[", "error": 0.9}, "DIFFERS", "raw/a/sgf.yaml: cannot be read: "),
    ],
)
def test_what_a_search_found_is_compared_but_for_what_it_was_made_with(results, add, again, word, what):
    first = TUNED.format(build="a", sigma=2, error=0.5)
    add(first, TUNED.format(**{"build": "a", **again}), "sgf.yaml", packages={"libc6": "2.35"})
    found = outcome(results)
    assert found[0] == word and found[1].startswith(what) and found[1].endswith("other packages")


def test_of_pictures_other_bits_are_not_said_to_agree(results, add, capsys, monkeypatch):
    monkeypatch.setattr(run, "lock", lambda folder: None)  # which would hold it to the end of this process
    add("1", "2", "a.png", packages={"libc6": "2.35"})
    assert outcome(results) == ("nothing to compare", "other bits: raw/a/a.png; other packages")
    assert not verify.verify(results, seed=1, minutes=10)
    add("x\n1\n", rule="table", folder="runs/b")
    assert verify.verify(results, seed=1, minutes=10)
    assert "nothing to compare" in capsys.readouterr().out


def test_a_command_that_fails_differs_and_says_why(results, add):
    add(state="done")
    node = json.loads((results / "runs/a/run.json").read_text())
    node["command"] = ["sh", "-c", "echo no disk >&2; exit 3"]
    record.write_json(results / "runs/a/run.json", node)
    assert outcome(results) == ("DIFFERS", "exit code 3: no disk")


def test_one_run_of_each_rule_is_drawn_within_the_time():
    runs = [Recorded(None, {"rule": rule}, wall_s) for rule, wall_s in (("a", 1), ("a", 2), ("b", 3), ("c", 99))]
    for seed in range(9):
        sample = verify.draw_sample(runs, seed, 60)
        assert [run.rule for run in sample] == ["a", "b"]
        assert verify.draw_sample(runs, seed, 60) == sample
    assert {verify.draw_sample(runs, seed, 60)[0].wall_s for seed in range(20)} == {1, 2}
    assert sum(run.wall_s for run in verify.draw_sample(runs, 1, 2)) <= 2


def test_only_runs_that_ended_well_and_made_more_than_timings_are_repeated(results, add):
    add(state="failed")
    assert verify.find_recorded(results) == []
    add()
    node = json.loads((results / "runs/a/run.json").read_text())
    for name in ("timings.csv", "tables/table3_timings.csv", "tables/bench_stereo.csv"):
        record.write_json(results / "runs/a/run.json", {**node, "outputs": {name: ""}})
        assert verify.find_recorded(results) == []


def test_files_beside_an_output_are_copied_but_for_trials_and_the_rest_is_linked(results, tmp_path):
    for name in ("raw/a/out", "raw/a/beside", "raw/a/study.db", "raw/b/other", ".cache/x"):
        (results / name).parent.mkdir(parents=True, exist_ok=True)
        (results / name).write_text("1")
    shown = tmp_path / "shown"
    verify.show_results(results, shown, [results / "raw" / "a" / "out"])
    assert not any((shown / name).exists() for name in ("raw/a/out", "raw/a/study.db", ".cache"))
    (shown / "raw/a/beside").write_text("2")
    assert (results / "raw/a/beside").read_text() == "1"
    assert (shown / "raw/b").is_symlink() and (shown / "raw/b/other").read_text() == "1"


def test_the_first_tolerance_that_fits_counts():
    tolerances = [Tolerance("*.csv", 0.1, 0, "a"), Tolerance("*.csv", 0, 0.5)]
    assert verify.agree("x.csv", "a", "1", "1.05", tolerances)
    assert not verify.agree("x.csv", "a", "1", "1.2", tolerances)
    assert verify.agree("x.csv", "b", "1", "1.2", tolerances)
    assert not verify.agree("x.csv", "b", "one", "two", tolerances)
    assert not verify.agree("x.txt", "", "1", "1.05", tolerances), "what no entry fits has to be equal"


def test_the_tolerances_of_the_project_can_be_read_and_are_none_for_names():
    tolerances = verify.load_tolerances()
    assert verify.agree("raw/a/x.csv", "invalid_pct", "20.1", "20.2", tolerances)
    assert not verify.agree("raw/a/x.csv", "invalid_pct", "20", "30", tolerances)
    assert not verify.agree("raw/a/x.csv", "scene", "Aloe", "Motorcycle", tolerances)


def test_values_have_the_names_of_columns_and_keys(tmp_path):
    (tmp_path / "a.json").write_text('{"a": {"b": [1, 2]}}')
    assert verify.read_values(tmp_path / "a.json") == [("a.b", "1"), ("a.b", "2")]
    (tmp_path / "a.csv").write_text("x,y\n1,2\n")
    assert verify.read_values(tmp_path / "a.csv") == [("x", "1"), ("y", "2"), ("", "x"), ("", "y")]


@pytest.mark.parametrize("exists", [True, False])
def test_where_nothing_was_run_it_says_so(tmp_path, capsys, monkeypatch, exists):
    results = tmp_path / "results"
    if exists:
        results.mkdir()
    monkeypatch.setattr(sys, "argv", ["verify", "--results", str(results)])
    assert verify.main() == 1
    assert "no finished run" in capsys.readouterr().err


@pytest.mark.parametrize("main, words", [(verify.main, []), (run.main, ["--bin", "none", "table1"])])
def test_a_folder_that_cannot_be_locked_is_an_error_in_a_line(results, capsys, monkeypatch, main, words):
    (results / ".lock").mkdir()
    monkeypatch.setattr(run.signal, "signal", lambda *_: None)
    monkeypatch.setattr(sys, "argv", ["main", "--results", str(results), *words])
    assert main() == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("Error: ") and str(results / ".lock") in line
