"""Table III: what is run, what counts as success, and what stands beside the paper's values."""

import copy
import dataclasses
import math
from pathlib import Path

import pandas as pd
import pytest
import yaml
from matplotlib import pyplot

from sgf_paper import config, odometry_scores, paths, summary, trajectory_table
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.tracking_config import TrackingColumn, TrackingProgram, load_published_trajectories

NODE = yaml.safe_load((paths.EXPERIMENTS / "table3_dso.yaml").read_text())
RENDERED = ["MH_01_easy", "MH_03_medium", "V1_02_medium", "V1_03_difficult"]
# Of four runs on a path of 2 m: ATE RMSE in m (infinite: lost), and success by sgf_eval's two rules.
RUNS = {
    "photo": [(0.010, True, True), (0.041, True, True), (math.inf, False, False), (0.020, True, True)],
    "sgf": [(0.010, True, True), (0.040, True, True), (0.020, False, True), (0.030, True, False)],
}


@pytest.fixture
def study(experiments):
    """The experiment with two columns, and two sequences under the light."""
    node = copy.deepcopy(NODE)
    node["columns"] = {name: node["columns"][name] for name in RUNS}
    node["compared"] = ["sgf"]
    del node["conditions"]["local_light"]
    node["conditions"]["light"]["changes"] = {name: {"gamma": 2.2, "encode": False} for name in RENDERED[:2]}
    (experiments / "table3_dso.yaml").write_text(yaml.safe_dump(node, sort_keys=False))
    return config.load_experiment("table3_dso")


@pytest.mark.parametrize(
    "change, message",
    [
        ({"compared": ["sgf", "sbd"]}, r"compared: no column \['sbd'\]"),
        ({"runs": 0}, "runs is 0; it has to be positive"),
        ({"conditions": {"light": {"changes": {"MH_01_easy": {"gamma": 2}}}}}, "must change nothing"),
        ({"conditions": {"light": {"changes": {"MH_09": {}}}}}, r"conditions.light: no sequence \['MH_09'\]"),
        ({"columns": {"photo": {"program": "dso"}}}, "columns.photo: no program 'dso'"),
        ({"columns": {"photo": {"options": {}}}}, "columns.photo: key 'program' is missing"),
        ({"programs": {"sgf_direct": {"frame": "body"}}}, "programs.sgf_direct: key 'align' is missing"),
        ({"sequences": {"a": {"folder": "b"}}}, "sequences.a: key 'contents' is missing"),
    ],
)
def test_mistakes_are_named(experiments, change, message):
    (experiments / "bad.yaml").write_text(yaml.safe_dump({**NODE, **change}))
    with pytest.raises(ConfigError, match=message):
        config.load_experiment("bad")


def test_the_papers_ten_sequences_and_v2_03_are_there():
    table = config.load_experiment("table3_dso")
    published = load_published_trajectories(table)
    labels = [sequence.published for sequence in table.sequences.values() if sequence.published]
    assert [*labels[:-1], "avg"] == list(published["photo"]) == list(published["sgf"])
    assert labels[-1] == "V23" and published["ngv_motion"] == {}
    assert published["photo"]["V13"] == 1.075 and published["sgf"]["V13"] == 0.933


def test_an_unknown_row_of_the_paper_is_an_error(study):
    study.columns["sgf"] = TrackingColumn("sgf_direct", published="dso_sbd")
    with pytest.raises(ConfigError, match=r"no entry table_3_euroc_ate_m.\['dso_sbd'\]"):
        load_published_trajectories(study)


@pytest.mark.parametrize(
    "images, found",
    [(0, []), (1, ["euroc_MH_01_cut"]), (999, ["euroc_MH_01_cut"]), (1000, ["euroc_MH_01"])],
)
def test_a_cut_and_the_whole_are_told_apart_by_their_images(study, tmp_path, images, found):
    camera = tmp_path / "euroc" / "MH_01_easy" / "mav0" / "cam0"
    camera.mkdir(parents=True)
    if images:
        (camera / "data.csv").write_text("#timestamp [ns],filename\n" + "1,1.png\n" * images)
    assert study.present("") == RENDERED
    assert study.present(str(tmp_path)) == [*RENDERED, *found]


def flags_of(study, sequence, condition, column, run=0):
    words = study.flags(sequence, Path("/Suite") / sequence, False, run, condition, column)
    return dict(zip(words[::2], words[1::2]))


def test_rendered_sequences_are_calibrated_unless_the_light_changes(study):
    undisturbed = flags_of(study, "MH_01_easy", "undisturbed", "sgf")
    assert undisturbed["--photometric"] == "/Suite/MH_01_easy/mav0/cam0"
    assert undisturbed["--depth.residual"] == "sgf"
    light = flags_of(study, "MH_01_easy", "light", "photo", run=1)
    changes = [light[f"--change.{name}"] for name in ("gamma", "encode", "seed")]
    assert changes == ["2.2", "false", "2"]
    assert light["--from"] == str(study.first_frame(1)) != "0"
    assert not {"--photometric", "--depth.residual", "--frames"} & set(light)
    assert "--photometric" not in flags_of(study, "euroc_MH_01", "undisturbed", "sgf")


def test_a_program_that_takes_no_calibration_gets_none(study):
    study.programs["sgf_vio"] = TrackingProgram(frame="body", align="se3")
    study.columns["vio"] = TrackingColumn("sgf_vio")
    assert "--photometric" not in flags_of(study, "MH_01_easy", "undisturbed", "vio")
    assert study.program("vio") == "sgf_vio"
    assert study.score_flags("vio") == ["--frame", "body", "--align", "se3"]


def test_light_is_changed_on_the_sequences_that_say_how(study):
    assert study.conditions_of("MH_01_easy") == ["undisturbed", "light"]
    assert study.conditions_of("V1_02_medium") == study.conditions_of("euroc_MH_01") == ["undisturbed"]
    assert sorted(study.first_frame(run) for run in range(25)) == list(range(25))


def test_runs_are_scored_on_their_own_poses_and_on_common_ones(study, write_runs, sgf_eval, tmp_path):
    program, calls = sgf_eval
    runs = write_runs(["undisturbed"], {"photo": 3, "sgf": 4}, {"photo": 95, "sgf": 100})
    table = odometry_scores.score(study, "V1_02_medium", tmp_path, runs, program).set_index("column")
    assert list(table.columns)[-2:] == ["success_by_scale", "success_by_ate"]
    assert table.loc["sgf", ["ate_m", "own_ate_m", "success_by_ate"]].tolist() == [4, 4, True]
    assert len(calls()) == 4 and [call.count("--common") for call in calls()] == [0, 1, 0, 1]
    for call in calls():
        assert call[call.index("--frame") + 1] == "camera" and call[call.index("--align") + 1] == "sim3"


@pytest.fixture
def raw(study, write_scores):
    """Scores of four runs on two sequences under both conditions."""

    def line(condition, column, run):
        error, by_scale, by_ate = RUNS[column][run]
        lost = math.isinf(error)
        counts = {"condition": condition, "column": column, "frames": 80, "posed": 40 if lost else 80}
        counts |= {"lost": lost, "clipped_pct": 1}
        own = {"path_m": 2, "own_ate_m": error, "success_by_scale": by_scale, "success_by_ate": by_ate}
        scores = dict.fromkeys(odometry_scores.ERRORS.values(), error) | {"compared": 80, **own}
        return counts | ({} if lost else scores)

    runs = [
        [line(condition, column, run) for condition in study.conditions for column in RUNS]
        for run in range(4)
    ]
    for sequence in RENDERED[:2]:
        raw = write_scores(study, sequence, runs)
    return raw


@pytest.fixture
def lines(study, raw):
    return trajectory_table.read_runs(study, raw, RENDERED[:2], 4)


def test_success_takes_the_rule_enough_poses_and_an_error_small_beside_the_path(lines):
    own = lines[(lines["sequence"] == "MH_01_easy") & (lines["condition"] == "light")]
    success = own.groupby("column")[["success_scale", "success_ate"]].agg(list)
    assert success.loc["photo"].tolist() == [[True, False, False, True]] * 2  # 41 mm are above 2 % of 2 m
    assert success.loc["sgf"].tolist() == [[True, True, False, True], [True, True, True, False]]
    assert (own["failed"] == ~own["success_scale"]).all()
    assert own.loc[own["failed"], trajectory_table.ERRORS].eq(math.inf).all(axis=None)


def test_quantiles_hold_failed_runs_as_infinite(study, lines):
    table = trajectory_table.make_table(study, lines).set_index(["sequence", "condition", "column"])
    photo, sgf = (table.loc["MH_01_easy", "light", column] for column in RUNS)
    assert (photo["runs"], photo["lost"], photo["failed"], photo["success_ate"]) == (4, 1, 2, 2)
    assert photo["posed_pct"] == pytest.approx(87.5) and photo["ate_mm"] == photo["ate_q75_mm"] == math.inf
    assert (sgf["ate_mm"], sgf["ate_q75_mm"], sgf["ate_q90_mm"]) == (35, 40, math.inf)
    assert sgf["ate_mean_of_successes_mm"] == pytest.approx(80 / 3)
    assert table["published_mm"].isna().all()


def test_success_is_compared_over_all_sequences(study, lines):
    compared = trajectory_table.compare(study, lines).set_index(["condition", "rule"])
    assert len(compared) == 4 and set(compared["runs"]) == {4}
    for rule in ("scale", "ate"):
        found = compared.loc[("light", rule), ["column", "baseline", "sequences", "pairs"]]
        assert found.tolist() == ["sgf", "photo", 2, 8]
    fields = ["both", "only_own", "only_baseline", "difference_pct"]
    assert compared.loc[("light", "scale"), fields].tolist() == [4, 2, 0, 25]
    assert compared.loc[("light", "ate"), fields].tolist() == [2, 4, 2, 25]


def test_errors_are_compared_pair_by_pair_over_all_sequences_and_in_each(study, lines):
    compared = trajectory_table.compare_errors(study, lines).set_index(["condition", "sequence"])
    assert len(compared) == 2 * (1 + 2)
    # of the runs: equal, the baseline fails, both fail, 30 mm over 20 mm
    for sequence, runs in (("all", 2), ("MH_03_medium", 1)):
        own = compared.loc[("light", sequence)]
        assert (own["column"], own["baseline"]) == ("sgf", "photo")
        assert (own["pairs"], own["both_failed"], own["ratio"]) == (4 * runs, runs, 1)
        assert (own["ratio_low"], own["ratio_high"], own["verdict"]) == (0, 1.5, "undecided")


def test_runs_that_begin_alike_do_not_narrow_intervals(study, lines):
    again = pd.concat([lines, lines.assign(run=lines["run"] + 4)])
    bounds = [f"{name}_{end}_mm" for name in ("ate", "ate_mean") for end in ("low", "high")]
    once, twice = (trajectory_table.make_table(study, runs)[bounds] for runs in (lines, again))
    pd.testing.assert_frame_equal(once, twice)


@pytest.mark.parametrize("verdict_runs, said", [(4, "better"), (5, "undecided")])
def test_a_verdict_on_errors_takes_enough_runs_of_each_sequence(study, lines, verdict_runs, said):
    study.verdict_runs = verdict_runs
    better = lines.assign(failed=False, ate_mm=lines["column"].map({"photo": 20, "sgf": 10}))
    compared = trajectory_table.compare_errors(study, better)
    assert set(compared["verdict"]) == {said} and set(compared["ratio_high"]) == {0.5}


def test_published_values_stand_beside_whole_sequences(study, lines):
    renamed = {"MH_01_easy": "euroc_MH_01", "MH_03_medium": "euroc_MH_01_cut"}
    table = trajectory_table.make_table(study, lines.replace({"sequence": renamed}))
    published = table.set_index(["sequence", "condition", "column"])["published_mm"].dropna()
    assert published.round(6).to_dict() == {
        ("euroc_MH_01", "undisturbed", "photo"): 51,
        ("euroc_MH_01", "undisturbed", "sgf"): 71,
    }


def test_files_and_summary_show_what_failed(study, raw, tmp_path):
    tables = tmp_path / "tables"
    tables.mkdir()
    trajectory_table.make_trajectory_table("table3_dso", raw, RENDERED[:2], 4, tables, tmp_path)
    document = (tables / "table3_dso.md").read_text()
    assert "| MH_01_easy | photo | 2/4 | 2/4 | 87.5 | 1.00 | ∞ [10.0, ∞] | ∞ [10.0, ∞] | ∞ | ∞ |" in document
    assert "| light | scale | sgf | photo | 2 | 8 | 4 | 2 | 0 | +25.0 [" in document
    assert "| light | all | sgf | photo | 8 | 2 | 1.00 [0.00, 1.50] | undecided |" in document
    assert "- `MH_03_medium`: gamma 2.2, encode false\n" in document
    assert "left out: V1_02_medium, V1_03_difficult, euroc_MH_01_cut, euroc_MH_01, " in document
    latex = (tables / "table3_dso.tex").read_text()
    assert "MH\\_01\\_easy & photo & 2/4 & 2/4 & 87.5 & $\\infty$ [10.0, $\\infty$]" in latex
    every = pd.read_csv(tables / "table3_dso_runs.csv")
    assert len(every) == 32 and every["failed"].sum() == 4 * (2 + 1)
    assert list(every["first_frame"].unique()) == [study.first_frame(run) for run in range(4)]
    few = [line.strip() for line in summary.stage_lines(study, tmp_path, 0)[1:]]
    assert few[0].startswith("runs of each line: 4; comparisons take 10 (tables/table3_dso.md")
    enough = dataclasses.replace(study, verdict_runs=4)
    said = [line.strip() for line in summary.stage_lines(enough, tmp_path, 0)[1:]]
    assert said[-len(few) + 1 :] == few[1:]
    assert said[2].startswith(
        "light, success by scale rule, 8 pairs of runs: sgf 6, photo 4, difference +25 [+0, "
    )
    assert "light, ATE of sgf over that of photo, 8 pairs of runs: 1.00 [0.00, 1.50], undecided" in said
    assert said[-1] == "MH_03_medium, light, median ATE mm: sgf 35.0 (1/4 failed), photo inf (2/4 failed)"


def test_curves_end_at_the_share_of_runs_that_succeed(study, lines):
    drawing = trajectory_table.draw(study, lines)
    assert [axis.get_title() for axis in drawing.axes] == [
        f"{condition} (sequences: 2, runs of each column: 8)" for condition in study.conditions
    ]
    curves = {line.get_label(): line for line in drawing.axes[1].lines}
    assert curves["photo"].get_ydata()[-1] == 50 and curves["sgf"].get_ydata()[-1] == 75
    assert list(curves["sgf"].get_xdata()[1:-1]) == pytest.approx([10, 10, 30, 30, 40, 40])
    drawing.canvas.draw()
    pyplot.close(drawing)


def test_a_condition_under_which_everyone_fails_is_drawn(study, lines):
    drawing = trajectory_table.draw(study, lines.assign(failed=True, ate_mm=math.inf))
    assert all(set(line.get_ydata()) == {0} for axis in drawing.axes for line in axis.lines)
    drawing.canvas.draw()
    pyplot.close(drawing)


@pytest.mark.parametrize("name", ["table3_dso", "table3_vio"])
def test_the_comparisons_of_the_reference_are_those_of_its_runs(name):
    study = config.load_experiment(name)
    runs = pd.read_csv(paths.REFERENCE / f"{name}_runs.csv")
    for end, compare in (("_compared", trajectory_table.compare), ("_ate_compared", trajectory_table.compare_errors)):
        stated = pd.read_csv(paths.REFERENCE / f"{name}{end}.csv")
        pd.testing.assert_frame_equal(compare(study, runs), stated, check_dtype=False, rtol=2e-3, atol=1e-4)
