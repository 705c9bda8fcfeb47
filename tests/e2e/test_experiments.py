"""reproduce.sh: what it makes, what it makes anew, and how it goes on after an interruption."""

import csv
import shutil

import yaml

from conftest import PROJECT

SWEEP = yaml.safe_load((PROJECT / "paper" / "sweeps" / "stereo_bm.yaml").read_text())
COLUMNS = list(SWEEP["columns"])
FILES = {
    "tables": [
        f"{table}{end}"
        for table in ("table1", "table2")
        for end in (".csv", ".md", ".tex", "_scenes.csv", "_tuned.csv", "_wins.csv")
    ]
    + ["density.csv", "density_equal.csv", "density.md", "bench_stereo.csv", "bench_stereo.md"],
    "figures": [f"{name}.{end}" for name in ("density", "fig4", "fig5") for end in ("pdf", "png")],
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
    assert sorted(project.calls()) == sorted(f"debian_pairs {column}" for column in COLUMNS)
    summary = output[output.index("== summary") :]
    assert "table1         made        tables/table1.md" in summary
    assert "debian_pairs all, 2 scenes, mean px: sgf" in summary
    assert "motorcycle_741x500: sgf 2.29 times cv::StereoBM (avx3, 1 thread)" in summary
    assert "Data sets absent: middlebury2014_h (https://" in summary

    times = {path: path.stat().st_mtime_ns for path in project.results.glob("*/*.*")}
    code, output = project.run()
    assert code == 0
    assert output.count("up to date") == 6 and " made " not in output
    assert len(project.calls()) == len(COLUMNS)
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
    sgf = [row for row in table if row["cost"] == "sgf" and row["dataset"] == "debian_pairs"]
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
    assert [(r["region"], r["published"], r["scenes"]) for r in sgf] == [("noc", "1.61", "2")]
    assert "middlebury2014_q" in output[output.index("Data sets absent") :]
    assert "kitti2015" not in output[output.index("Data sets absent") :]


def test_new_scenes_and_another_folder_are_scored_anew(project):
    project.add_dataset("kitti2015", ["000000"])
    project.run("--only", "table2", SGF_DATA=str(project.data))
    project.add_dataset("kitti2015", ["000001"])
    project.run("--only", "table2", SGF_DATA=str(project.data))
    assert project.calls().count("kitti2015 sgf") == 2
    moved = project.data.rename(project.data.parent / "moved")
    project.run("--only", "table2", "--data", str(moved))
    assert project.calls().count("kitti2015 sgf") == 3
    assert project.calls().count("debian_pairs sgf") == 1


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
    assert {row["window"] for row in scenes} == {"11"}
    sweep = project.root / "paper" / "sweeps" / "stereo_bm.yaml"
    sweep.write_text(sweep.read_text().replace("[5, 7,", "[7,"))
    project.run("--only", "table1")
    assert len(project.calls()) == 2 * len(COLUMNS)


def test_a_failing_job_names_its_log_and_leaves_the_rest_standing(project):
    project.bin.mkdir(parents=True)
    (project.bin / "fail").write_text("pm")
    code, output = project.run("--only", "table1", "fig4")
    log = project.results / "logs" / "scores_stereo_bm_debian_pairs_pm.log"
    assert code == 1
    assert f"FAILED scores: raw/stereo_bm/debian_pairs/pm.csv; log: {log}" in output
    assert "| sgf_eval: column pm was told to fail" in output
    assert "table1         NOT MADE" in output and "fig4           made" in output
    assert len(project.calls()) == len(COLUMNS) - 1, "the other columns go on"
    (project.bin / "fail").unlink()
    code, output = project.run("--only", "table1", "fig4")
    assert code == 0
    assert sorted(project.calls()) == sorted(f"debian_pairs {column}" for column in COLUMNS)


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


def test_what_has_no_data_is_left_out_and_said(project):
    shutil.rmtree(project.root / "datasets" / "generated" / "debian_pairs")
    script = project.root / "datasets" / "debian_pairs.py"
    script.write_text("import sys\nsys.exit('Error: no pair is installed')\n")
    code, output = project.run()
    assert code == 1
    assert "Error: no pair is installed" in output and "no data set at hand" in output
    project.add_dataset("kitti2015", ["000000", "000001"])
    code, output = project.run("--only", "table1", "table2", "bench_stereo", "--data", str(project.data))
    assert code == 0, output
    for name in ("table1", "bench_stereo"):
        assert f"{name:14} left out: its data are not at hand" in output
    assert "table2         made" in output
    assert "debian_pairs (" in output[output.index("Data sets absent") :]
