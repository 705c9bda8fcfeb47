"""What Snakemake hears of jobs on a cluster, and what runs have cost."""

import os

import pytest

from sgf_paper import cluster, cost, record


@pytest.fixture
def command(tmp_path, monkeypatch):
    """Puts a shell script in place of a command; each call is noted in `calls`."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/usr/bin:/bin")

    def write(name, body):
        file = tmp_path / "bin" / name
        file.write_text(f"#!/bin/sh\necho {name} $* >>{tmp_path / 'calls'}\n{body}\n")
        file.chmod(0o755)
        return tmp_path / "calls"

    return write


UNKNOWN = "echo 'slurm_load_jobs error: Invalid job id specified' >&2; exit 1"


@pytest.mark.parametrize(
    "state, status",
    [
        ("PENDING", "running"), ("RUNNING", "running"), ("COMPLETING", "running"), ("COMPLETED", "success"),
        ("FAILED", "failed"), ("TIMEOUT", "failed"), ("OUT_OF_MEMORY", "failed"), ("NODE_FAIL", "failed"),
    ],
)  # fmt: skip
def test_a_jobs_state_is_the_controllers(command, state, status):
    command("scontrol", f"echo 'JobId=7 JobName=a JobState={state} Reason=None'")
    assert cluster.status_of("7") == status


@pytest.mark.parametrize(
    "body, status", [("echo COMPLETED", "success"), ("echo 'CANCELLED by 0'", "failed"), ("exit 1", "failed")]
)
def test_of_a_job_that_the_controller_has_forgotten_the_accounting_knows(command, body, status):
    command("scontrol", UNKNOWN)
    command("sacct", body)
    assert cluster.status_of("7") == status


def test_while_the_controller_does_not_answer_a_job_is_taken_to_run(command):
    command("scontrol", "echo 'Unable to contact slurm controller' >&2; exit 1")
    assert cluster.status_of("7") == "running"


def test_the_smallest_node_says_how_many_processors_a_job_may_have(command):
    command("sinfo", "echo 64; echo 8+")
    assert cluster.node_cores() == 8


def test_what_is_missing_or_fails_is_named(command, monkeypatch):
    command("sinfo", "echo 'sinfo: error: no partition' >&2; exit 1")
    with pytest.raises(cluster.ClusterError, match="^sinfo: .*no partition"):
        cluster.node_cores()
    monkeypatch.setenv("PATH", "/nonexistent")
    with pytest.raises(cluster.ClusterError, match="^sinfo is not installed"):
        cluster.node_cores()


def test_jobs_of_the_same_results_are_ended_and_waited_for(command, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "POLL_S", 0)
    command("scancel", "")
    calls = command("squeue", f"[ $(grep -c squeue {tmp_path / 'calls'}) -ge 3 ] || echo 7")
    cluster.end_leftovers(tmp_path)
    name = cluster.job_name(tmp_path)
    assert calls.read_text().split("\n")[0] == f"scancel --me --name={name}"
    assert calls.read_text().count(f"squeue --noheader --format=%i --me --name={name}") == 3
    assert cluster.job_name(tmp_path / "other") != name
    monkeypatch.setattr(cluster, "END_S", -1)
    command("squeue", "echo 7")
    with pytest.raises(cluster.ClusterError, match="do not end"):
        cluster.end_leftovers(tmp_path)


def test_submission_has_a_folder_for_what_jobs_print(tmp_path):
    flags = cluster.snakemake_flags(tmp_path / "a b", 9)
    assert flags[:2] == ["--jobs", "9"] and f"--output='{tmp_path}/a b/logs/slurm/%j.log'" in flags[3]
    assert os.path.isdir(tmp_path / "a b" / "logs" / "slurm")


def test_costs_are_added_up_by_rule_and_experiment_those_of_most_time_first(tmp_path):
    for index, (rule, file, cpu_s, state) in enumerate([
        ("few", "raw/fig1.csv", 3600, "done"),
        ("many", "raw/stereo_bm/set/a.csv", 2700, "done"),
        ("many", "raw/stereo_bm/set/b.csv", 1800, "done"),
        ("many", "raw/stereo_bm/set/c.csv", 9, "failed"),
        ("many", "raw/mesh/set/a.csv", 36, "done"),
    ]):  # fmt: skip
        folder = tmp_path / "runs" / str(index)
        record.write_json(folder / "run.json", {"rule": rule, "outputs": {file: ""}, "exit": {"state": state}})
        record.write_json(folder / "timing.json", {"cpu_s": cpu_s, "peak_mib": 100 + index})
    assert cost.cost_table(tmp_path).splitlines()[2:] == [
        "| `many` stereo_bm | 2 | 2250.0 | 2700.0 | 1.250 | 102 |",
        "| `few` | 1 | 3600.0 | 3600.0 | 1.000 | 100 |",
        "| `many` mesh | 1 | 36.0 | 36.0 | 0.010 | 104 |",
    ]
