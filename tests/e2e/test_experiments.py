"""reproduce.sh: what it makes, what it makes anew, and how it goes on after an interruption."""

import csv
import re
import shutil

import pytest
import yaml

from conftest import PROJECT, main_columns

SWEEPS = [yaml.safe_load(path.read_text()) for path in (PROJECT / "paper" / "sweeps").glob("*.yaml")]
COLUMNS = [f"{sweep['name']}/{column}" for sweep in SWEEPS for column in main_columns(sweep)]
CHANGED = [f"{column} {change}" for column in COLUMNS for change in ("encoded", "linear")]
EXPERIMENTS = sorted(
    path.stem
    for path in (PROJECT / "paper" / "experiments").glob("*.yaml")
    if not yaml.safe_load(path.read_text()).get("by_name_only")
)
ODOMETRY = ["odometry", "odometry_parts"]
PARTS = ["table3_dso", "table3_vio"]
TRACKED = [*ODOMETRY, *PARTS]
# These need no data set.
DRAWN = ["convergence", "fig1", "fig2", "fig3", "fig6", "mrpt_map", *TRACKED, "table3", "scenes", "sequences"]
RENDERED = [*DRAWN, "report", "tune_tiny"]
SHORT = ["MH_01_easy", "MH_03_medium", "V1_02_medium", "V1_03_difficult"]
PICTURES = ["density", *DRAWN, "fig1_curves", "fig4", "fig5", "light_change"]
FILES = {
    "tables": [
        f"{table}{end}"
        for table in ("table1", "table2")
        for end in (".csv", ".md", ".tex", "_scenes.csv", "_tuned.csv", "_wins.csv")
    ]
    + ["density.csv", "density_equal.csv", "density.md", "bench_stereo.csv", "bench_stereo.md"]
    + ["fig1.csv", "fig1_curves.csv", "fig1.md", "fig2.csv", "fig2_minima.csv"]
    + ["convergence.csv", "convergence.md", "fig6.csv", "fig6.md", "mrpt_map.csv", "mrpt_map.md"]
    + [f"{name}{end}" for name in TRACKED for end in (".csv", "_compared.csv", "_runs.csv", ".md")]
    + [f"{name}{end}" for name in PARTS for end in ("_ate_compared.csv", ".tex")]
    + [f"table3{end}" for end in (".csv", "_light.csv", "_timings.csv", ".md", ".tex")]
    + ["tune_tiny.csv", "tune_tiny.md"]
    + [f"report{end}.csv" for end in ("_claims", "_pairs", "_values", "_verdicts")]
    + ["fig3.csv", "fig3.md", "sequences.csv", "sequences.md", "light_change.csv", "light_change.md"],
    "figures": [f"{name}.{end}" for name in PICTURES for end in ("pdf", "png")],
}


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def made(project):
    return {
        folder: sorted(path.name for path in (project.results / folder).iterdir())
        for folder in ("tables", "figures")
    }


def test_everything_is_made_once_and_then_up_to_date(project):
    code, output = project.run("--jobs", "2")
    assert code == 0, output
    assert made(project) == {folder: sorted(names) for folder, names in FILES.items()}
    calls = sorted(f"debian_pairs {column}" for column in [*COLUMNS, *CHANGED])
    assert sorted(project.calls()) == calls
    renderings = project.renderings()
    assert renderings.count("pair") == renderings.count("sequence") == 1
    summary = output[output.index("== summary") :]
    assert "table1         made        tables/table1.md" in summary
    assert "debian_pairs all, 2 scenes, StereoBM, mean px: sgf" in summary
    # the stand-in doubles errors under a change
    for where in ("StereoBM, rise of mean px: sgf +1.45", "MeshStereo, rise of mean px: sgf +3.67"):
        assert f"debian_pairs all, encoded, {where}, pm" in summary
    assert "motorcycle_741x500: sgf_bm 2.30 times cv::StereoBM (avx3, 1 thread)" in summary
    assert "motorcycle_741x500: sgf_sgm 1.20 times cv::StereoSGBM (avx3, 1 thread)" in summary
    assert "light, converged from 2 px, %: photo 90, lssd 89, gn 88, sgf" in summary
    assert "V1_03_difficult, light, median ATE mm: sgf 1.0, photo inf (1/1 lost)" in summary
    assert "synthetic, sequences: 2, mean ATE mm: vio_lssd 1.0, vio_sgf 1.0" in summary
    assert "runs of each line: 1; comparisons take 10 (tables/table3_dso.md has what these say)" in summary
    assert "MH_03_medium, light, median ATE mm: sgf 1.0, photo inf (1/1 failed)" in summary
    assert "living_room noise_free, mean px: photo 1.00, ugf 2.00" in summary
    assert "checked, kept, median / 90th percentile of depth errors: sad 60 %, 1.0 / 20.0 cm" in summary
    assert "V1_02_medium: 10 of 10 frames with pose, 2 key-frames, 3 points, ATE RMSE 1.0 mm" in summary
    assert "spread of walls: photo 1.0 mm, 1.0 cm, 0.0 cm; sgf 1.0 mm, 1.0 cm, 0.0 cm" in summary
    assert "sequences      made        figures/sequences.png (.pdf), tables/sequences.md" in summary
    assert "values of the paper: not compared 235" in summary
    page = (project.results / "report.html").read_text()
    assert "Not shown: it has not been run; ./reproduce.sh --only tune makes it." in page
    assert page.count("Not shown:") == 1 and 'href="raw/stereo_bm/debian_pairs/sgf.csv"' in page
    assert "Data sets absent: middlebury2014_h (https://" in summary

    times = {path: path.stat().st_mtime_ns for path in project.results.glob("*/*.*")}
    code, output = project.run()
    assert code == 0
    assert output.count("up to date") == len(EXPERIMENTS) and " made " not in output
    assert len(project.calls()) == len(calls) and project.renderings() == renderings
    unchanged = [p for p, t in times.items() if p.stat().st_mtime_ns == t and "logs" not in str(p)]
    assert len(unchanged) >= sum(map(len, FILES.values()))


def test_progress_counts_to_the_end(project):
    _, output = project.run("--only", "table1", "--jobs", "1")
    total = len(COLUMNS) + 1
    lines = [line for line in output.splitlines() if line.startswith("  [")]
    counted = [line for line in lines if f"/{total}]" in line]
    assert len(counted) == total
    assert all("left" in line for line in counted[:-1]) and "left" not in counted[-1]


def test_tables_of_the_real_script_hold_the_stand_ins_scores(project):
    project.run("--only", "table1")
    table = rows(project.results / "tables" / "table1.csv")
    wanted = ("debian_pairs", "stereo_bm", "sgf")
    sgf = [row for row in table if (row["dataset"], row["matcher"], row["cost"]) == wanted]
    values = {(row["region"], row["quantity"]): row for row in sgf}
    # the stand-in at window 9, uniqueness 10: invalid 31, mean 1.38 and 1.518
    assert values["all", "invalid_pct"]["measured"] == "31.0000"
    assert values["all", "mean_px"]["measured"] == "1.4490"
    assert values["all", "mean_px"]["published"] == ""
    assert values["all", "mean_px"]["scenes"] == "2"


def test_downloaded_data_are_added_without_repeating_the_rest(project):
    assert project.run("--only", "table1", "table2", "fig5")[0] == 0
    project.add_dataset("kitti2015", ["000000", "000001"])
    project.add_dataset("middlebury2014_h", ["Teddy"])
    code, output = project.run("--only", "table1", "table2", "--data", str(project.data))
    assert code == 0, output
    scored = [call.split()[0] for call in project.calls()]
    assert {name: scored.count(name) for name in set(scored)} == {
        "debian_pairs": len(COLUMNS),
        "kitti2015": len(COLUMNS),
        "middlebury2014_h": len(COLUMNS),
    }
    table = rows(project.results / "tables" / "table2.csv")
    wanted = ("kitti2015", "sgf", "mean_px")
    sgf = [r for r in table if (r["dataset"], r["cost"], r["quantity"]) == wanted]
    assert [(r["matcher"], r["region"], r["published"], r["scenes"]) for r in sgf] == [
        ("stereo_bm", "noc", "1.61", "2"),
        ("stereo_mesh", "noc", "2.02", "2"),
        ("stereo_sgm", "noc", "", "2"),
    ]
    assert "middlebury2014_q" in output[output.index("Data sets absent") :]
    assert "kitti2015" not in output[output.index("Data sets absent") :]


def test_new_scenes_and_another_folder_are_scored_anew(project):
    project.add_dataset("kitti2015", ["000000"])
    project.run("--only", "table2", SGF_DATA=str(project.data))
    project.add_dataset("kitti2015", ["000001"])
    project.run("--only", "table2", SGF_DATA=str(project.data))
    assert project.calls().count("kitti2015 stereo_bm/sgf") == 2
    moved = project.data.rename(project.data.parent / "moved")
    project.run("--only", "table2", "--data", str(moved))
    assert project.calls().count("kitti2015 stereo_bm/sgf") == 3
    assert project.calls().count("debian_pairs stereo_bm/sgf") == 1


def test_a_changed_program_makes_its_results_anew(project):
    project.run("--only", "table1", "fig4")
    with (project.bin / "sgf_eval").open("a") as program:
        program.write("# another version\n")
    code, output = project.run("--only", "table1", "fig4")
    assert code == 0
    assert len(project.calls()) == 2 * len(COLUMNS)
    assert "table1         made" in output and "fig4           up to date" in output


def test_a_changed_sweep_or_table_makes_what_depends_on_it_anew(project):
    project.run("--only", "table1")
    table = project.root / "paper" / "experiments" / "table1.yaml"
    table.write_text(table.read_text().replace("{window: 9,", "{window: 11,"))
    _, output = project.run("--only", "table1")
    assert "table1         made" in output and len(project.calls()) == len(COLUMNS)
    scenes = rows(project.results / "tables" / "table1_scenes.csv")
    windows = {row["matcher"]: row["window"] for row in scenes}
    assert windows == {"stereo_bm": "11", "stereo_mesh": "35", "stereo_sgm": "5"}
    deviations = project.root / "paper" / "deviations.yaml"
    deviations.write_text(deviations.read_text().replace("orig: [mesh-orig]", "orig: [mesh-code]"))
    _, output = project.run("--only", "table1")
    assert "table1         made" in output and len(project.calls()) == len(COLUMNS)
    document = (project.results / "tables" / "table1.md").read_text()
    assert re.search(r"\| orig <sup>\[\d+\]\(\S+#mesh-code\)</sup> \|", document)
    sweep = project.root / "paper" / "sweeps" / "stereo_bm.yaml"
    sweep.write_text(sweep.read_text().replace("[5, 7,", "[7,"))
    project.run("--only", "table1")
    again = [column for column in COLUMNS if column.startswith("stereo_bm/")]
    assert len(project.calls()) == len(COLUMNS) + len(again)


def test_a_failing_job_names_its_log_and_leaves_the_rest_standing(project):
    project.fail("stereo_bm/pm")
    code, output = project.run("--only", "table1", "fig4")
    log = project.results / "logs" / "scores_stereo_bm_debian_pairs_pm.log"
    assert code == 1
    assert f"FAILED scores: raw/stereo_bm/debian_pairs/pm.csv; log: {log}" in output
    assert "| sgf_eval: column stereo_bm/pm was told to fail" in output
    assert "table1         NOT MADE" in output and "fig4           made" in output
    assert len(project.calls()) == len(COLUMNS) - 1, "the other columns go on"
    project.fail(None)
    code, output = project.run("--only", "table1", "fig4")
    assert code == 0
    assert sorted(project.calls()) == sorted(f"debian_pairs {column}" for column in COLUMNS)


def test_the_report_is_made_of_what_was_made_and_names_what_failed(project):
    project.fail("stereo_bm/pm")
    code, output = project.run("--only", "table1", "fig4", "report")
    assert code == 1 and "table1         NOT MADE" in output and "report         made" in output
    page = (project.results / "report.html").read_text()
    assert "Not shown: it failed; the run's output names the log." in page.replace("&#39;", "'")
    assert 'alt="fig4' in page and "Not shown: it has not been run; ./reproduce.sh --only table2" in page
    code, output = project.run("--only", "report")
    assert code == 0 and "report         up to date" in output, "and it still says what failed"


def test_what_fails_to_be_made_anew_is_shown_as_of_an_earlier_run(project):
    assert project.run("--only", "table1", "fig4", "report")[0] == 0
    table = (project.results / "tables" / "table1.csv").read_bytes()
    with (project.bin / "sgf_eval").open("a") as program:
        program.write("# another version\n")
    project.fail("stereo_bm/pm")
    code, output = project.run("--only", "table1", "fig4", "report")
    assert code == 1
    assert "table1         FAILED; what is shown is of an earlier run: tables/table1.md" in output
    assert "fig4           up to date" in output and "report         made" in output
    assert (project.results / "tables" / "table1.csv").read_bytes() == table
    reason = "it failed; the run's output names the log; what is shown is of an earlier run"
    assert (project.results / "stages.tsv").read_text() == f"table1\t{reason}\n"
    page = (project.results / "report.html").read_text().replace("&#39;", "'")
    assert page.count("Of an earlier run:") == 1 and f"Of an earlier run: {reason}." in page
    project.fail(None)
    code, output = project.run("--only", "table1", "report")
    assert code == 0 and "table1         made" in output
    assert "Of an earlier run" not in (project.results / "report.html").read_text()


def test_an_interrupted_run_goes_on_where_it_stopped(project, interrupt):
    process = project.start("--only", "table1", "--jobs", "1", SGF_FAKE_SECONDS="1")
    project.wait_for_calls(3)
    code, output = interrupt(process)
    assert code == 130
    assert "Interrupted; the same command goes on from here." in output
    begun = len(project.calls())
    assert begun < len(COLUMNS)
    code, _ = project.run("--only", "table1")
    assert code == 0
    assert len(project.calls()) <= len(COLUMNS) + 1
    assert (project.results / "tables" / "table1.md").exists()


def test_a_killed_run_leaves_no_lock_and_no_half_written_score(project, kill):
    process = project.start("--only", "table1", "--jobs", "1", SGF_FAKE_SECONDS="1")
    project.wait_for_calls(3)
    assert kill(process)[0] == -9
    code, output = project.run("--only", "table1")
    assert code == 0, output
    assert len(project.calls()) <= len(COLUMNS) + 1


def test_two_runs_do_not_share_a_results_folder(project, interrupt):
    first = project.start("--only", "table1", "--jobs", "1", SGF_FAKE_SECONDS="2")
    project.wait_for_calls(1)
    code, output = project.run("--only", "table1")
    interrupt(first)
    assert code == 1
    assert f"another run is at work in {project.results}" in output


def remove_debian_pairs(project):
    shutil.rmtree(project.root / "datasets" / "generated" / "debian_pairs")
    script = project.root / "datasets" / "debian_pairs.py"
    script.write_text("import sys\nsys.exit('Error: no pair is installed')\n")


def test_what_has_no_data_is_left_out_and_said(project):
    remove_debian_pairs(project)
    code, output = project.run("--only", "table1", "fig4")
    assert code == 1
    assert "Error: no pair is installed" in output and "(table1: its data are not at hand; fig4:" in output
    project.add_dataset("kitti2015", ["000000", "000001"])
    code, output = project.run("--only", "table1", "table2", "bench_stereo", "--data", str(project.data))
    assert code == 0, output
    for name in ("table1", "bench_stereo"):
        assert f"{name:14} left out: its data are not at hand" in output
    assert "table2         made" in output
    assert "debian_pairs (" in output[output.index("Data sets absent") :]


def test_what_is_rendered_needs_no_data(project):
    remove_debian_pairs(project)
    stages = ["fig1", "fig2", "fig6", "scenes", "table3_dso", "report", *(set(EXPERIMENTS) - set(RENDERED))]
    code, output = project.run("--only", *stages)
    assert code == 0, output
    for name in stages:
        state = "made  " if name in RENDERED else "left out"
        assert f"  {name:14} {state}" in output
    assert project.calls() == []
    assert "debian_pairs (" in output[output.index("Data sets absent") :]


def test_full_renders_the_full_suite_beside_the_short_one(project):
    suites = {}
    for flags in ([], ["--full"], []):
        code, output = project.run("--only", "sequences", *flags)
        assert code == 0 and "sequences      made" in output, output
        table = rows(project.results / "tables" / "sequences.csv")
        suites[bool(flags)] = {row["sequence"]: row["frames"] for row in table}
        assert float(table[0]["length_m"]) == pytest.approx(0.95 if flags else 0.45, abs=0.01)
    recipes = [path.stem for path in (PROJECT / "datasets" / "synthetic").glob("[MV]*.yaml")]
    assert suites[False] == dict.fromkeys(SHORT, "10.000")
    assert suites[True] == dict.fromkeys(sorted(recipes), "20.000") and len(recipes) == 11
    generated = project.root / "datasets" / "generated"
    assert sorted(path.name for path in (generated / "sequences").iterdir()) == SHORT
    assert project.renderings() == ["sequence", *SHORT, "sequence --full", *sorted(recipes)]


@pytest.mark.parametrize(
    "command, log, lost",
    [
        ("pair", "pairs.log", ["convergence", "fig1", "fig3", "scenes"]),
        ("sequence", "sequences_run.log", ["fig6", "mrpt_map", *TRACKED, "table3", "sequences", "tune_tiny"]),
    ],
)
def test_a_failing_renderer_fails_only_what_needs_it(project, command, log, lost):
    project.fail(command)
    stages = [*lost, "fig2", "report"]
    code, output = project.run("--only", *stages)
    assert code == 1
    stamp = {"pair": "pairs", "sequence": "sequences"}[command]
    assert f": raw/{stamp}.done; log: {project.results / 'logs' / log}" in output
    assert f"| sgf_render: {command} was told to fail" in output
    for name in stages:
        assert f"  {name:14} {'NOT MADE' if name in lost else 'made  '}" in output
    project.fail(None)
    code, output = project.run("--only", *stages)
    assert code == 0, output
    for name in stages:
        assert f"  {name:14} {'made  ' if name in [*lost, 'report'] else 'up to date'}" in output


def test_a_changed_recipe_is_rendered_anew(project):
    assert project.run("--only", "scenes", "sequences")[0] == 0
    recipe = project.root / "datasets" / "synthetic" / "V1_02_medium.yaml"
    recipe.write_text(recipe.read_text() + "# changed\n")
    code, output = project.run("--only", "scenes", "sequences")
    assert code == 0
    assert "sequences      made" in output and "scenes         up to date" in output
    recipe = recipe.with_name("pairs.yaml")
    recipe.write_text(recipe.read_text() + "# changed\n")
    code, output = project.run("--only", "scenes", "sequences")
    assert code == 0
    assert "scenes         made" in output and "sequences      up to date" in output
    renderings = project.renderings()
    assert renderings.count("pair") == renderings.count("sequence") == 2


def test_a_downloaded_sequence_joins_the_rendered_one(project):
    assert project.run("--only", "mrpt_map")[0] == 0
    raw = project.results / "raw" / "mrpt_map"
    before = (raw / "V1_02_medium" / "map.tum").stat().st_mtime_ns
    rendered = project.root / "datasets" / "generated" / "sequences" / "MH_01_easy"
    shutil.copytree(rendered, project.data / "euroc" / "MH_01_easy")
    code, output = project.run("--only", "mrpt_map", "--data", str(project.data))
    assert code == 0, output
    table = rows(project.results / "tables" / "mrpt_map.csv")
    assert [row["sequence"] for row in table] == ["V1_02_medium", "euroc_MH_01"]
    assert (raw / "V1_02_medium" / "map.tum").stat().st_mtime_ns == before
    assert not list((raw / "euroc_MH_01").glob("in*")), "the rawlog holds a copy of every image"


def test_the_surface_of_a_downloaded_sequence_is_not_known(project):
    rendered = project.root / "datasets" / "generated" / "sequences" / "MH_01_easy"
    assert project.run("--only", "fig6")[0] == 0
    shutil.copytree(rendered, project.data / "euroc" / "MH_01_easy")
    code, output = project.run("--only", "fig6", "--data", str(project.data))
    assert code == 0, output
    table = rows(project.results / "tables" / "fig6.csv")
    known = ["V1_02_medium", "MH_03_medium"]
    assert [row["sequence"] for row in table] == [name for name in [*known, "euroc_MH_01"] for _ in range(2)]
    assert {row["sequence"] for row in table if row["median_m"]} == set(known)
    assert not list((project.results / "raw" / "fig6" / "euroc_MH_01").glob("*_offsets.csv"))


def test_downloaded_frames_join_the_generated_ones(project):
    assert project.run("--only", "fig1")[0] == 0
    scores = project.results / "raw" / "fig1" / "living_room_sofa.csv"
    before = scores.stat().st_mtime_ns
    folder = project.data / "icl_nuim" / "living_room_kt2" / "rgb"
    folder.mkdir(parents=True)
    for frame in ("120", "808"):
        (folder / f"{frame}.png").write_bytes(b"")
    code, output = project.run("--only", "fig1", "--data", str(project.data))
    assert code == 0, output
    table = rows(project.results / "tables" / "fig1.csv")
    published = {(row["group"], row["frame"]): row["published"] for row in table if row["cost"] == "sgf"}
    frames = [("living_room", "bookcases"), ("living_room", "sofa"), ("icl_kt2", "120"), ("icl_kt2", "808")]
    assert list(published) == frames
    assert scores.stat().st_mtime_ns == before
    assert project.renderings().count("pair") == 1


def test_more_runs_are_added_to_those_made_before(project):
    tracked = []
    for flags in ([], ["--runs", "2"], []):
        code, output = project.run("--only", "odometry", *flags)
        assert code == 0, output
        table = rows(project.results / "tables" / "odometry_runs.csv")
        tracked.append((len(project.trackings()), len(table)))
    assert tracked == [(4, 4), (8, 8), (8, 4)]
    assert project.trackings().count("V1_03_difficult photo 2") == 2


def test_downloaded_sequences_are_tracked_from_where_they_lie(project):
    assert project.run("--only", "odometry")[0] == 0
    project.add_dataset("euroc", ["MH_01_easy"])
    code, output = project.run("--only", "odometry", "--data", str(project.data))
    assert code == 0, output
    table = rows(project.results / "tables" / "odometry.csv")
    assert [row["sequence"] for row in table] == ["V1_03_difficult"] * 4 + ["euroc_MH_01"] * 4
    assert len(project.trackings()) == 8


def test_a_changed_condition_makes_its_runs_anew(project):
    assert project.run("--only", "odometry")[0] == 0
    study = project.root / "paper" / "experiments" / "odometry.yaml"
    study.write_text(study.read_text().replace("vignette: 0.5", "vignette: 0.6"))
    code, output = project.run("--only", "odometry")
    assert code == 0 and "odometry       made" in output, output
    assert len(project.trackings()) == 4 + 2


def test_table_3_takes_the_calibration_of_what_is_rendered_and_tells_cuts_from_the_whole(project):
    cut, whole = (project.data / "euroc" / name for name in ("MH_01_easy", "MH_02_easy"))
    for folder, images in ((cut, 999), (whole, 1000)):
        camera = folder / "mav0" / "cam0"
        camera.mkdir(parents=True)
        (camera / "data.csv").write_text("#timestamp [ns],filename\n" + "1,1.png\n" * images)
    code, output = project.run("--only", "table3_dso", "--data", str(project.data))
    assert code == 0, output
    assert sorted(project.trackings()) == sorted(
        [f"MH_03_medium {residual} 1{note}" for residual in ("photo", "sgf") for note in ("", " calibrated")]
        + [f"{folder.name} {residual} 1" for folder in (cut, whole) for residual in ("photo", "sgf")]
    )
    table = rows(project.results / "tables" / "table3_dso.csv")
    assert [(row["sequence"], row["condition"], row["column"], row["published_mm"]) for row in table] == [
        ("MH_03_medium", "undisturbed", "sgf", ""),
        ("MH_03_medium", "undisturbed", "photo", ""),
        ("MH_03_medium", "light", "sgf", ""),
        ("MH_03_medium", "light", "photo", ""),
        ("euroc_MH_01_cut", "undisturbed", "sgf", ""),
        ("euroc_MH_01_cut", "undisturbed", "photo", ""),
        ("euroc_MH_02", "undisturbed", "sgf", "50.0000"),
        ("euroc_MH_02", "undisturbed", "photo", "45.0000"),
    ]
    assert not list((project.results / "raw" / "table3_dso").rglob("*.ply")), "maps are large"


def write_external(project, name, line):
    path = project.results / "external" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(line + "\n")


def table3_values(project, system):
    """What table 3 has of a system by sequence, error and success."""
    table = rows(project.results / "tables" / "table3.csv")
    kept = [row for row in table if row["system"] == system and row["quantity"] in ("ate_mean_m", "success_pct")]
    return [(row["sequence"], row["measured"], row["runs"]) for row in kept]


def test_table_3_makes_its_parts_and_takes_in_other_systems(project):
    write_external(project, "my slam/MH_03_medium.txt", "1400000000.1 0 0 0 0 0 0 1")
    write_external(project, "my slam/MH_04_difficult.txt", "1400000000.1 0 0 0 0 0 0 1")
    code, output = project.run("--only", "table3")
    assert code == 0, output
    for name in PARTS:
        assert (project.results / "tables" / f"{name}.md").exists()
    runs = len(project.trackings())
    scored = [("MH_03_medium", "0.001000", "1"), ("MH_03_medium", "100.00", "1")]
    assert table3_values(project, "my slam") == table3_values(project, "vio_sgf")[-2:] == scored
    assert "not at hand: my slam/MH_04_difficult." in (project.results / "tables" / "table3.md").read_text()
    write_external(project, "other/MH_03_medium.csv", "1400000000100000000,0,0,0,1,0,0,0")
    assert project.run("--only", "table3")[0] == 0
    assert table3_values(project, "other") == scored and len(project.trackings()) == runs
    shutil.rmtree(project.results / "external" / "my slam")
    assert project.run("--clean")[0] == 0 and (project.results / "external" / "other").is_dir()
    assert project.run("--only", "table3")[0] == 0
    assert table3_values(project, "my slam") == [] and table3_values(project, "other") == scored


@pytest.mark.parametrize(
    "name, line, message",
    [
        ("a/MH_03_medium.txt", "1400000000.1 0 0 0 0 0 1", "a/MH_03_medium.txt:1: has 7 fields, and a pose takes 8"),
        ("a/MH03.txt", "", "a/MH03.txt: no sequence is called MH03; known: MH_03_medium, MH_01_easy"),
    ],
)
def test_a_bad_file_of_another_system_is_named(project, name, line, message):
    write_external(project, name, line)
    code, output = project.run("--only", "table3", "table3_vio")
    assert code == 1
    assert f"| Error: {project.results}/external/{message}" in output
    assert "table3         NOT MADE" in output and "table3_vio     made" in output


# Of a column: a run that shows the defaults, and on each fold three trials and the defaults held out, two
# conditions each. What was found is the defaults, as all errors are alike.
FLIGHTS_OF_TUNING = 1 + 2 * (3 + 1) * 2


def test_what_is_tuned_is_written_with_both_folds_and_not_tuned_again(project):
    code, output = project.run("--only", "tune", "--jobs", "1")
    assert code == 0 and "tune           made        tuned/*.yaml, tables/tune.md (.csv)" in output, output
    assert len(project.flights()) == FLIGHTS_OF_TUNING
    assert {flight.split()[2] for flight in project.flights()} == {"1001", "1002"}, "not the table's"
    found = yaml.safe_load((project.results / "tuned" / "sgf.yaml").read_text())
    assert found["build"]["revision"] == "fake" and set(found["data"]) == {"MH_01_easy", "MH_03_medium"}
    assert [(fold["trained_on"], fold["parameters"]) for fold in found["folds"]] == [
        (["MH_03_medium"], found["defaults"]),
        (["MH_01_easy"], found["defaults"]),
    ]
    assert found["folds"][0]["held_out"]["tuned"] == {"error_pct": 0.2222, "failed": 0}
    assert "sgf tuned on MH_03_medium, error elsewhere, % of the path: 0.22, by default 0.22;" in output
    (project.results / "tuned" / "sgf.yaml").unlink()
    code, output = project.run("--only", "tune")
    held_out = 1 + 2 * 2
    assert code == 0 and len(project.flights()) == FLIGHTS_OF_TUNING + held_out, "trials are in the database"


def test_a_killed_tuning_goes_on_with_the_trials_that_are_missing(project, kill):
    process = project.start("--only", "tune", "--jobs", "1", SGF_FAKE_SECONDS="0.5")
    project.wait_for_calls(6, project.flights)
    assert kill(process)[0] == -9
    begun = len(project.flights())
    code, output = project.run("--only", "tune")
    assert code == 0, output
    assert len(project.flights()) <= FLIGHTS_OF_TUNING + begun - 4, "trials that were done are not repeated"


def use_tuned(project, parameters):
    """Has table3_vio take tuned options; those of `sgf` by fold."""
    study = project.root / "paper" / "experiments" / "table3_vio.yaml"
    text = study.read_text().replace("tuned: false\n", "tuned: true\n")
    assert "tuned: true\n" in text
    study.write_text(text)
    for column in ("sgf", "lssd"):
        file = study.parent / "tuned" / f"{column}.yaml"
        node = yaml.safe_load(file.read_text())
        for fold in node["folds"]:
            fold["parameters"] = parameters[fold["trained_on"][0]] if column == "sgf" else {}
        file.write_text(yaml.safe_dump(node))


def test_table_3_takes_the_options_of_the_fold_that_a_sequence_is_not_in(project):
    found = {"MH_01_easy": 0.25, "MH_03_medium": 0.75}
    use_tuned(project, {name: {"flow.max_backward_px": value} for name, value in found.items()})
    code, output = project.run("--only", "table3_vio", "tune_tiny")
    assert code == 0, output
    taken = sorted(flight for flight in project.flights() if flight.split()[2] == "1")
    wanted = [f"{name} sgf 1 {value}" for name, value in (("MH_01_easy", 0.75), ("MH_03_medium", 0.25))]
    wanted += [f"{name} lssd 1 default" for name in found]
    assert taken == sorted(2 * wanted)
    document = (project.results / "tables" / "table3_vio.md").read_text()
    assert "the options that were found without it" in document


def test_table_3_says_what_it_lacks_without_tuned_options(project):
    use_tuned(project, {"MH_01_easy": {}, "MH_03_medium": {}})
    file = project.root / "paper" / "experiments" / "tuned" / "sgf.yaml"
    file.unlink()
    code, output = project.run("--only", "table3_vio")
    assert code == 1
    assert f"{file}: is missing; `./reproduce.sh --only tune` makes results/tuned/sgf.yaml" in output
