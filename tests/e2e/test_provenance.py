"""What runs leave of themselves, `--verify`, and the same tables from a cluster and after kills."""

import json
import os
import random
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from conftest import HERE, Project
from same_results import end, made

# Of each kind of job one and more: programs, scores, tables and figures, and a search with a database.
STAGES = ["table1", "fig2", "odometry", "table3_vio", "tune_tiny", "scenes"]
MOMENTS = 4  # same_results.py kills the real programs ten times


def recorded(project):
    """All run.json by their folders in the results."""
    files = [path for top in ("raw", "runs") for path in (project.results / top).rglob("run.json")]
    return {str(path.parent.relative_to(project.results)): json.loads(path.read_text()) for path in files}


def test_each_run_leaves_what_it_was_made_of_and_can_be_verified(project):
    code, output = project.run("--only", *STAGES)
    assert code == 0, output
    runs = recorded(project)
    run = runs["raw/table3_vio/MH_03_medium/run_0/light/sgf"]
    assert run["exit"] == {"state": "done", "code": 0} and run["rule"] == "tracking_run"
    assert run["command"][0] == str(project.bin / "sgf_vio")
    assert run["options"]["build"]["revision"] == run["build"]["revision"] == "fake"
    assert run["seeds"]["--change.seed"] == "1"
    sequence = project.root / "datasets" / "generated" / "sequences" / "MH_03_medium"
    assert set(run["inputs"]) >= {str(project.bin / "sgf_vio"), str(sequence)}
    assert {run["rule"] for run in runs.values()} >= {"scores", "table", "tuned_column", "pairs", "tracking_scores"}
    flights = project.flights()
    code, output = project.run("--verify")
    assert code == 0, output
    tried = [{line.split()[3] for line in lines} for lines in (flights, project.flights()[len(flights) :])]
    assert tried[0] == tried[1] and len(tried[0]) > 2, "the trials of a search are made again"
    for rule in ("scores", "table", "odometry", "tracking_run", "tracking_scores", "tuned_column", "contact_sheet"):
        assert f"\n  {rule:18} same bits " in output, output
    assert "DIFFERS" not in output and "within tolerances" not in output


def test_every_program_of_a_map_the_benchmark_and_the_report_are_on_record(project):
    code, output = project.run("--only", "fig6", "mrpt_map", "bench_stereo", "report")
    assert code == 0, output
    runs = recorded(project)
    scored = [node for node in runs.values() if node["rule"] in ("direct_map_scores", "mrpt_map_scores")]
    assert scored and all(Path(name).exists() for node in scored for name in node["command"][:1])
    made = {Path(name).name for node in scored for name in node["outputs"]}
    assert made == {"body.txt", "map.ply", "scores.json"}
    converted = [node["command"] for node in runs.values() if node["rule"] == "mrpt_map_rawlog"]
    assert converted and all(command[command.index("-n") + 1].isdigit() for command in converted)
    (benchmark,) = [node for node in runs.values() if node["rule"] == "benchmark_run"]
    assert benchmark["command"][:3] == ["/usr/bin/env", "-u", "GLIBC_TUNABLES"]  # timed as users run it
    assert any(word.startswith("SGF_BENCH_PAIR=/") for word in benchmark["command"])
    report = runs["runs/report.html"]
    assert {"tables/fig6.csv", "figures/fig6.png", "tables/bench_stereo.md"} <= set(report["inputs"])
    assert {"report.html", "tables/report_values.csv"} <= set(report["outputs"])
    code, output = project.run("--verify")
    assert code == 0, output
    for rule in ("direct_map_run", "direct_map_scores", "mrpt_map_scores", "write_report"):
        assert f"\n  {rule:18} same bits " in output, output


def test_what_cannot_be_repeated_alike_is_found(project):
    code, output = project.run("--verify")
    assert code == 1 and "no finished run" in output
    assert project.run("--only", "fig2")[0] == 0
    file = project.results / "runs" / "raw" / "fig2" / "run.json"
    run = json.loads(file.read_text())
    file.write_text(json.dumps({**run, "outputs": {**run["outputs"], "raw/fig2/minima.csv": "0"}}))
    code, output = project.run("--verify")
    assert code == 1 and "(other bits: raw/fig2/minima.csv)" in output, output
    file.write_text(json.dumps(run))
    with (project.bin / "sgf_study").open("a") as program:
        program.write("# another version\n")
    code, output = project.run("--verify")
    assert code == 0 and "(other inputs)" in output, output


def test_a_failed_run_is_on_record(project):
    project.fail("stereo_bm/pm")
    assert project.run("--only", "table1")[0] == 1
    assert recorded(project)["runs/raw/stereo_bm/debian_pairs/pm.csv"]["exit"] == {"state": "failed", "code": 1}


@pytest.fixture
def slurm(tmp_path):
    """The environment of a Slurm cluster of this machine alone."""
    if os.getuid() != 0 or not shutil.which("slurmctld", path="/usr/sbin"):
        pytest.skip("takes root and Debian's slurm-wlm and munge")
    script, folder = HERE / "one_node_slurm.sh", tmp_path / "slurm"
    try:
        subprocess.run([script, "up", folder], check=True, timeout=120)
        yield {"SLURM_CONF": str(folder / "slurm.conf")}
    finally:
        subprocess.run([script, "down", folder], check=True, timeout=120)


def queue(environment):
    command = ["squeue", "--noheader", "--format=%j"]
    return subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True).stdout.split()


@pytest.mark.xdist_group("slurm")  # one cluster at a time
def test_slurm_makes_the_same_tables_and_goes_on_after_a_kill(project, tmp_path, slurm, kill):
    stages = ["fig2", "table3_vio"]
    assert project.run("--only", *stages)[0] == 0
    other = Project(tmp_path / "other")
    process = other.start("--cluster", "slurm", "--only", *stages, SGF_FAKE_SECONDS="5", **slurm)
    other.wait_for_calls(2, other.flights)
    assert kill(process)[0] == -9
    assert queue(slurm), "jobs stay in the queue"
    code, output = other.run("--cluster", "slurm", "--only", *stages, **slurm)
    assert code == 0, output
    assert made(other.results) == made(project.results)
    assert sorted(recorded(other)) == sorted(recorded(project)) and not queue(slurm)


@pytest.mark.xdist_group("slurm")  # one cluster at a time
def test_a_job_that_fails_on_the_cluster_names_its_log(project, slurm):
    project.fail("pair")
    code, output = project.run("--cluster", "slurm", "--only", "scenes", **slurm)
    assert code == 1
    assert f"raw/pairs.done; log: {project.results / 'logs' / 'pairs.log'}" in output
    assert "| sgf_render: pair was told to fail" in output


def test_without_a_cluster_it_says_so(project):
    (project.root / "slurm.conf").touch()
    code, output = project.run("--cluster", "slurm", "--only", "fig2", SLURM_CONF=str(project.root / "slurm.conf"))
    assert code == 1 and ("slurm.conf" in output or "is not installed" in output)


@pytest.mark.xdist_group("kills")  # so that what they are compared with is made once
@pytest.mark.parametrize("moment", range(MOMENTS))
def test_killed_at_a_random_moment_it_makes_the_same_when_started_again(moment, undisturbed, tmp_path):
    wanted, seconds = undisturbed
    project = Project(tmp_path)
    process = project.start("--only", *STAGES, SGF_FAKE_SECONDS="0.1")
    try:
        process.wait(timeout=random.Random(moment).uniform(0, seconds))
    except subprocess.TimeoutExpired:
        end(process, whole_group=moment % 2 == 0)
    code, output = project.run("--only", *STAGES)
    process.stdout.close()
    assert code == 0, output
    assert made(project.results) == wanted
    assert {run["exit"]["state"] for run in recorded(project).values()} == {"done"}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """What a run makes that nobody kills, and how long it takes."""
    project = Project(tmp_path_factory.mktemp("undisturbed"))
    started = time.monotonic()
    code, output = project.run("--only", *STAGES, SGF_FAKE_SECONDS="0.1")
    assert code == 0, output
    return made(project.results), time.monotonic() - started
