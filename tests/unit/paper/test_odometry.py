"""Odometry under changing light: how runs are started and scored, and what becomes of lost ones."""

import copy
import dataclasses
import math
import sys
from pathlib import Path

import pandas as pd
import pytest
import yaml
from matplotlib import pyplot

from sgf_paper import config, odometry, odometry_scores, paths, repeated_runs, run, summary, text
from sgf_paper.strict_yaml import ConfigError

NODE = yaml.safe_load((paths.EXPERIMENTS / "odometry.yaml").read_text())
RENDERED = ["V1_03_difficult", "MH_03_medium"]
# ATE in mm of three runs, lost where infinite: undisturbed and under light.
ATE_MM = {
    "sgf": ([10, 20, 30], [20, 30, 30]),
    "bit_planes": ([20, 40, 60], [40, math.inf, 60]),
    "photo": ([5, 5, math.inf], [math.inf] * 3),
}


@pytest.fixture
def study(experiments):
    """The experiment with fewer columns, and baselines to fit."""
    node = copy.deepcopy(NODE)
    node["columns"] = {name: node["columns"][name] for name in ATE_MM}
    node |= {"compared": ["sgf"], "baselines": ["bit_planes"], "verdict_runs": 3}
    (experiments / "odometry.yaml").write_text(yaml.safe_dump(node, sort_keys=False))
    return config.load_experiment("odometry")


@pytest.mark.parametrize(
    "change, message",
    [
        ({"compared": ["sgf", "sbd"]}, r"compared: no column \['sbd'\]"),
        ({"baselines": ["sbd"]}, r"baselines: no column \['sbd'\]"),
        ({"runs": 0}, "runs is 0; it has to be positive"),
        ({"runs": "two"}, "bad.yaml: runs: expected int, found 'two'"),
        ({"runs": True}, "bad.yaml: runs: expected int, found True"),
        ({"conditions": {}}, "the first one must change nothing"),
        ({"conditions": {"light": 2}}, "conditions.light: expected a map, found 2"),
        ({"first_frames": 0}, "first_frames is 0; it has to be positive"),
        ({"first_frames": 9}, "first_frames is 9; a verdict takes 10 runs that begin at different ones"),
        ({"conditions": {"light": {"gamma": 2}}}, "the first one must change nothing"),
        ({"sequences": {"a": {"folder": "b"}}}, "sequences.a: key 'contents' is missing"),
    ],
)
def test_mistakes_are_named(experiments, change, message):
    (experiments / "bad.yaml").write_text(yaml.safe_dump({**NODE, **change}))
    with pytest.raises(ConfigError, match=message):
        config.load_experiment("bad")


def test_downloaded_sequences_join_the_rendered_ones(study, tmp_path):
    assert study.present("") == study.present(str(tmp_path)) == RENDERED
    (tmp_path / "euroc" / "MH_01_easy").mkdir(parents=True)
    assert study.present(str(tmp_path)) == [*RENDERED, "euroc_MH_01"]
    real, rendered = (study.sequences[name] for name in ("euroc_MH_01", "MH_03_medium"))
    assert real.path(Path("suite"), str(tmp_path)) == tmp_path / "euroc" / "MH_01_easy"
    assert rendered.path(Path("suite"), str(tmp_path)) == Path("suite/MH_03_medium")


def test_runs_begin_at_different_frames_with_exposures_of_their_own(study):
    assert sorted(study.first_frame(run) for run in range(15)) == list(range(15))
    first, second = (
        study.flags("MH_03_medium", Path(), False, run, "light", "sgf") for run in (0, 1)
    )
    flags = dict(zip(second[::2], second[1::2]))
    assert flags["--alignment.residual"] == "sgf"
    assert flags["--change.exposure-low"] == "0.5" and flags["--change.encode"] == "false"
    assert flags["--from"] == str(study.first_frame(1)) != "0" and flags["--change.seed"] == "2"
    assert flags["--frames"] == "50"
    assert first[first.index("--change.seed") + 1] == "1"
    assert "--frames" in study.flags("euroc_MH_01", Path(), True, 0, "light", "sgf")
    for name, full in (("MH_03_medium", True), ("kitti_90", False)):
        assert "--frames" not in study.flags(name, Path(), full, 0, "light", "sgf")
    assert "--change.gamma" not in study.flags("MH_03_medium", Path(), False, 0, "undisturbed", "sgf")


@pytest.fixture
def runs(study, write_runs):
    """What sgf_align leaves of the runs that begin alike: `photo` has a pose too few."""
    errors = {column: error for error, column in enumerate(study.columns, 1)}
    posed = {column: 94 if column == "photo" else 95 for column in study.columns}
    return write_runs(study.conditions, errors, posed)


def test_lost_runs_have_no_errors_and_no_part_in_those_of_others(study, runs, sgf_eval, tmp_path):
    program, calls = sgf_eval
    folder = tmp_path / "sequence"
    table = odometry_scores.score(study, "MH_03_medium", folder, runs, program).set_index("column")
    assert list(table["lost"]) == [False, False, True] * 2
    assert table["ate_m"].isna().equals(table["lost"])
    assert list(table.loc["bit_planes", "ate_m"]) == [2, 2] and table.loc["sgf", "posed"].iloc[0] == 95
    assert (table["clipped_pct"] == 1.25).all()
    assert len(calls()) == 4
    for call in calls():
        common = call[call.index("--common") + 1 :]
        assert len({call[1], *common}) == 4 and not any("photo" in file for file in common)
        assert call[2:5] == ["--sequence", str(folder), "--out"]


def test_common_frames_too_few_for_errors_are_an_error(study, runs, sgf_eval, tmp_path):
    (runs / "light" / "sgf" / "trajectory.txt").write_text("null")
    with pytest.raises(odometry_scores.ScoresError, match="light/sgf/trajectory.txt: 99 common"):
        odometry_scores.score(study, "MH_03_medium", tmp_path, runs, sgf_eval[0])


def test_the_command_says_in_a_line_what_cannot_be_scored(study, runs, sgf_eval, tmp_path, monkeypatch):
    flags = ["--folder", tmp_path, "--program", sgf_eval[0], "--runs", runs, "--out", tmp_path / "scores.csv"]
    monkeypatch.setattr(sys, "argv", ["scores", "odometry", "MH_03_medium", *map(str, flags)])
    (runs / "light" / "sgf" / "trajectory.txt").write_text("null")
    with pytest.raises(SystemExit, match="Error: .*light/sgf/trajectory.txt: 99 common poses are too few"):
        odometry_scores.main()
    sgf_eval[0].write_text("#!/bin/sh\nexit 3\n")
    with pytest.raises(SystemExit, match="Error: .*sgf/trajectory.txt: sgf_eval cannot score it .exit code 3."):
        odometry_scores.main()


@pytest.fixture
def raw(study, write_scores):
    """Scores of three runs on one sequence."""

    def line(condition, column, run, error):
        lost = math.isinf(error)
        counts = {"condition": condition, "column": column, "frames": 60, "posed": 30 if lost else 60}
        counts |= {"lost": lost, "clipped_pct": run}
        scores = dict.fromkeys(odometry_scores.ERRORS.values(), error / 1000)
        scores |= {"rpe_one_second_deg": 1.5, "compared": 60}
        return counts | ({} if lost else scores)

    runs = [
        [
            line(condition, column, run, errors[index][run])
            for index, condition in enumerate(study.conditions)
            for column, errors in ATE_MM.items()
        ]
        for run in range(3)
    ]
    return write_scores(study, "MH_03_medium", runs)


@pytest.fixture
def lines(study, raw):
    return odometry.read_runs(study, raw, ["MH_03_medium"], 3)


def test_medians_hold_lost_runs_as_infinite(study, lines):
    table = odometry.make_table(study, lines).set_index(["condition", "column"])
    photo = table.loc["undisturbed", "photo"]
    assert (photo["ate_mm"], photo["ate_high_mm"], photo["lost"], photo["runs"]) == (5, math.inf, 1, 3)
    assert photo["posed_pct"] == pytest.approx(100 * (1 + 1 + 0.5) / 3) and photo["clipped_pct"] == 1
    light = table.loc["light", "photo"]
    assert light["ate_mm"] == light["rpe_one_second_mm"] == light["orientation_deg"] == math.inf
    assert light["lost"] == 3


def test_ratios_are_of_the_same_run_undisturbed(study, lines):
    table = odometry.make_table(study, lines).set_index(["condition", "column"])
    sgf = table.loc["light", "sgf"]  # 20 / 10, 30 / 20, 30 / 30
    assert (sgf["ratio"], sgf["ratio_low"], sgf["ratio_high"], sgf["ratio_runs"]) == (1.5, 1, 2, 3)
    assert math.isnan(table.loc["undisturbed", "sgf"]["ratio"])
    photo = table.loc["light", "photo"]  # lost, lost, and lost in both
    assert (photo["ratio"], photo["ratio_runs"]) == (math.inf, 2)


def test_columns_are_compared_run_by_run(study, lines):
    compared = odometry.compare(study, lines).set_index("condition")
    assert list(compared["column"] + compared["baseline"]) == ["sgfbit_planes"] * 2
    assert compared.loc["undisturbed", ["ratio", "verdict"]].tolist() == [0.5, "better"]
    # 20 / 40, 30 / lost, 30 / 60
    assert compared.loc["light", ["ratio", "ratio_low", "ratio_high"]].tolist() == [0.5, 0, 0.5]


def test_runs_that_begin_alike_are_no_further_evidence(study, lines):
    again = pd.concat([lines, lines.assign(run=lines["run"] + 3)])
    columns = ["ate_mm", "ate_low_mm", "ate_high_mm", "ratio", "ratio_low", "ratio_high", "ratio_runs"]
    once, twice = (odometry.make_table(study, runs)[columns] for runs in (lines, again))
    pd.testing.assert_frame_equal(once, twice)
    pd.testing.assert_frame_equal(odometry.compare(study, lines), odometry.compare(study, again))
    alike = odometry.compare(study, lines.assign(first_frame=lines["run"] // 2))
    assert set(alike["verdict"]) == {"undecided"} and set(alike["runs"]) == {2}


def test_more_runs_than_first_frames_are_said_to_repeat(study):
    study = dataclasses.replace(study, first_frames=2)
    said = text.render("sequences_run.md.j2", **repeated_runs.document_context(study, ["MH_03_medium"], 3))
    assert "Of the 3 runs only 2 begin at different frames" in said
    assert run.repeats(study, 2) == ""
    assert run.repeats(study, 3) == "odometry: 3 runs begin at 2 different frames; undisturbed, the others repeat"


def test_files_and_summary_show_what_was_lost(study, raw, tmp_path):
    tables = tmp_path / "tables"
    tables.mkdir()
    odometry.make_odometry("odometry", raw, ["MH_03_medium"], 3, tables, tmp_path)
    document = (tables / "odometry.md").read_text()
    assert "| sgf | 0/3 | 100.0 | 1.00 | 30.0 [20.0, 30.0] | 1.50 [1.00, 2.00] | 30.0 | 1.50 |" in document
    assert "| photo | 3/3 | 50.0 | 1.00 | ∞ [∞, ∞] | ∞ [∞, ∞] | ∞ | ∞ |" in document
    assert "| photo | 1/3 | 83.3 | 1.00 | 5.0 [5.0, ∞] | – | 5.0 | 1.50 |" in document
    assert "| MH_03_medium | undisturbed | sgf | bit_planes | 3 | 0.50 [0.50, 0.50] | better |" in document
    assert "`light`: gamma 2.2, encode false" in document
    assert "left out: V1_03_difficult, euroc_MH_01, kitti_90." in document
    every = pd.read_csv(tables / "odometry_runs.csv")
    assert len(every) == 18 and every["lost"].sum() == 5
    assert list(every["first_frame"].unique()) == [study.first_frame(run) for run in range(3)]
    said = summary.stage_lines(study, tmp_path, 0)[2].strip()
    assert said == (
        "MH_03_medium, light, median ATE mm: sgf 30.0, bit_planes 60.0 (1/3 lost), photo inf (3/3 lost)"
    )


def test_the_figure_has_a_dot_for_each_run_that_is_not_lost_and_counts_the_others(study, lines):
    drawing = odometry.draw(study, lines)
    axis = drawing.axes[0]
    dots = [line for line in axis.lines if line.get_marker() == "."]
    assert sum(len(line.get_xdata()) for line in dots) == 18 - 5
    assert [label.get_text() for label in axis.texts] == ["1/3", "1/3", "3/3"]
    crosses = [line for line in axis.lines if line.get_marker() == "x"]
    assert len(crosses) == 3
    assert len(drawing.axes) == 1
    pyplot.close(drawing)


def test_the_figure_has_a_panel_for_each_sequence(study, lines):
    names = ["one", "two", "three"]
    drawing = odometry.draw(study, pd.concat([lines.assign(sequence=name) for name in names]))
    visible = [axis for axis in drawing.axes if axis.get_visible()]
    assert [axis.get_title() for axis in visible] == names
    pyplot.close(drawing)


def test_a_sequence_that_everyone_loses_is_drawn(study, lines):
    everyone = lines.assign(lost=True, ate_mm=math.inf)
    drawing = odometry.draw(study, everyone)
    assert len(drawing.axes[0].texts) == 6
    drawing.canvas.draw()
    pyplot.close(drawing)
