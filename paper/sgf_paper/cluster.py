"""Jobs on a Slurm cluster: how Snakemake submits them, asks after them and ends them.

    cluster.py JOB   prints running, success or failed: what became of a job (Snakemake's --cluster-status)

A cluster without accounting will do: Slurm's controller knows a job for some minutes after its end.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import time
from pathlib import Path

PYTHON = "/usr/bin/python3"  # Debian's, which has Snakemake; another may stand first on the PATH
ENDED = {"COMPLETED": "success"}
FAILED = {
    "BOOT_FAIL", "CANCELLED", "DEADLINE", "FAILED", "NODE_FAIL", "OUT_OF_MEMORY", "PREEMPTED", "REVOKED", "TIMEOUT",
}  # fmt: skip
LATENCY_S = 60  # that a shared folder may take to show on one machine what another has written
POLL_S = 0.5
END_S = 120  # that jobs may take to end when told to


class ClusterError(Exception):
    """Why a cluster cannot be used."""


def _ask(*command: str) -> str:
    """What a command of Slurm prints. @throws ClusterError with its message where it fails."""
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise ClusterError(f"{command[0]} is not installed: is this a machine of the cluster?") from error
    if done.returncode:
        raise ClusterError(f"{command[0]}: {done.stderr.strip()}")
    return done.stdout


def job_name(results: Path) -> str:
    """The name of all jobs that work in a results folder, by which they are found again."""
    return f"sgf-{hashlib.sha256(str(results).encode()).hexdigest()[:12]}"


def node_cores() -> int:
    """Processors of the cluster's smallest node: what a job may ask for wherever it runs."""
    cores = _ask("sinfo", "--noheader", "--format=%c").split()
    if not cores:
        raise ClusterError("sinfo: the cluster has no node")
    return min(int(count.rstrip("+")) for count in cores)


def snakemake_flags(results: Path, jobs: int) -> list[str]:
    """What tells Snakemake to submit a job for each of its own. @param jobs submitted at a time.

    Makes the folder for what jobs print; Slurm does not.
    """
    logs = results / "logs" / "slurm"
    logs.mkdir(parents=True, exist_ok=True)
    submit = [
        "sbatch --parsable",
        f"--job-name={job_name(results)}",
        "--cpus-per-task={threads} --mem={resources.mem_mb} --time={resources.runtime}",
        f"--output='{logs}/%j.log'",
    ]
    return [
        "--jobs", str(jobs),
        "--cluster", " ".join(submit),
        "--cluster-status", f"{PYTHON} '{Path(__file__).resolve()}'",
        "--cluster-cancel", "scancel",
        "--latency-wait", str(LATENCY_S),
    ]  # fmt: skip


def end_leftovers(results: Path) -> None:
    """Ends the jobs that a killed run has left in the queue or at work.

    @throws ClusterError if they do not end.
    """
    mine = ["--me", f"--name={job_name(results)}"]
    _ask("scancel", *mine)
    deadline = time.time() + END_S
    while _ask("squeue", "--noheader", "--format=%i", *mine).strip():
        if time.time() > deadline:
            raise ClusterError(f"jobs of an earlier run do not end: squeue --name={job_name(results)}")
        time.sleep(POLL_S)


def _state_of(job: str) -> str:
    """A job's state by the controller, or else by the accounting; empty if neither knows it."""
    done = subprocess.run(["scontrol", "show", "job", "--oneliner", job], capture_output=True, text=True)
    fields = dict(field.split("=", 1) for field in done.stdout.split() if "=" in field)
    if done.returncode == 0:
        return fields.get("JobState", "")
    if "Invalid job id" not in done.stderr:
        return "RUNNING"  # the controller does not answer: ask again
    try:
        return _ask("sacct", "--noheader", "--allocations", "--parsable2", "--format=State", "--jobs", job).strip()
    except ClusterError:
        return ""


def status_of(job: str) -> str:
    """What Snakemake wants to hear of a job."""
    state = _state_of(job).split(" ")[0].rstrip("+")
    return ENDED.get(state, "failed" if state in FAILED or not state else "running")


if __name__ == "__main__":
    print(status_of(sys.argv[1]))
