"""Makes experiments of paper/experiments: data sets, then Snakemake, then a summary.

What is up to date is not made again, an interrupted run goes on where it stopped, and a failed job
names its log. Exit code 0 if every stage that has data was made, 130 if interrupted, else 1.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from sgf_paper import cluster, config, file_lock, paths, summary
from sgf_paper.experiment import Experiment
from sgf_paper.progress import clock
from sgf_paper.stereo_datasets import Dataset, dataset_flags, read_datasets
from sgf_paper.strict_yaml import ConfigError

PYTHON = cluster.PYTHON
MARK = "SGF_RESULTS"  # in the environment of all that a run starts: the folder it works for
DEFAULT_RESOURCES = {"mem_mb": 2000, "runtime": 120}  # of a job; minutes; the Snakefile has the others
PROGRESS = str(paths.PAPER / "sgf_paper" / "progress.py")
LOCK_S = 5  # for what a killed run has started to end


class RunError(Exception):
    """Why a run cannot go on."""


@dataclass(frozen=True)
class Settings:
    """Folders (absolute) and the number of parallel jobs."""

    bin: Path
    results: Path
    data: str  # empty: no downloaded data sets
    generated: Path
    jobs: int  # on a cluster: submitted at a time
    full: bool  # the full suites of rendered sequences
    runs: int  # of experiments that repeat runs; 0 for as many as they say
    on_cluster: bool = False  # a Slurm job for each of Snakemake's

    @property
    def logs(self) -> Path:
        return self.results / "logs"


def lock(results: Path) -> int:
    """Takes the results folder for this process and those it starts; the open file that holds it."""
    descriptor = file_lock.take(results / ".lock", LOCK_S)
    if descriptor is None:
        raise RunError(f"another run is at work in {results}")
    return descriptor


def _leftovers(results: Path) -> list[int]:
    """Processes that a run in this folder has started, by their environment; its own children are not asked."""
    mark, found = f"{MARK}={results}".encode(), []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if mark in (process / "environ").read_bytes().split(b"\0"):
                found.append(int(process.name))
        except OSError:
            continue  # another user's, or gone
    return [process for process in found if process != os.getpid()]


def end_leftovers(settings: Settings) -> None:
    """Ends jobs of a run that was killed, which would write what is about to be made.

    To be called with the lock held, before anything is started.
    @throws RunError if they do not end.
    """
    deadline = time.monotonic() + cluster.END_S
    while left := _leftovers(settings.results):
        if time.monotonic() > deadline:
            raise RunError(f"processes of an earlier run do not end: {left}")
        for process in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        time.sleep(0.1)
    if settings.on_cluster:
        cluster.end_leftovers(settings.results)


def make_debian_pairs(settings: Settings) -> None:
    """Converts the pairs that Debian packages ship; says so and goes on where they are left out."""
    script = paths.PROJECT / "datasets" / "debian_pairs.py"
    out = settings.generated / "debian_pairs"
    done = subprocess.run([PYTHON, script, out], capture_output=True, text=True)
    (settings.logs / "debian_pairs.log").write_text(done.stdout + done.stderr)
    for line in (done.stdout + done.stderr).splitlines():
        print(f"  {line}", flush=True)


def find_datasets(settings: Settings) -> dict[str, Dataset]:
    """Has sgf_eval list the data sets at hand and keeps the list as results/datasets.tsv."""
    log = settings.logs / "datasets.log"
    flags = dataset_flags(settings.data, str(settings.generated))
    with log.open("w") as errors:
        command = [settings.bin / "sgf_eval", "datasets", *flags]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=errors, text=True)
    if done.returncode:
        raise RunError(f"data sets cannot be listed: {log.read_text().strip()} (log: {log})")
    listing = settings.results / "datasets.tsv"
    listing.write_text(done.stdout)
    return read_datasets(listing)


def obstacle(stage: Experiment, datasets: dict[str, Dataset], programs: Path) -> str:
    """Why a stage cannot be made; empty if it can be."""
    if stage.kind == "mrpt_map" and not (programs / "sgf-odometry-cli").exists():
        return "the MRPT module is not part of the build"
    return "" if stage.has_data(datasets) else "its data are not at hand"


def repeats(stage: Experiment, runs: int) -> str:
    """What is to be known of more runs than a stage has first frames; empty if there are not."""
    if stage.kind not in ("odometry", "trajectory_table") or runs <= stage.first_frames:
        return ""
    return f"{stage.name}: {runs} runs begin at {stage.first_frames} different frames; undisturbed, the others repeat"


def _where(settings: Settings) -> list[str]:
    """What tells Snakemake where to run jobs, and how many at a time."""
    if settings.on_cluster:
        return cluster.snakemake_flags(settings.results, settings.jobs)
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") >> 20
    return ["--cores", str(settings.jobs), "--resources", f"mem_mb={memory}"]


def _snakemake_command(settings: Settings, stages: list[Experiment], flags: list[str]) -> list[str]:
    values = {
        "stages": " ".join(stage.name for stage in stages),
        "bin": settings.bin,
        "data": settings.data,
        "generated": settings.generated,
        "full": int(settings.full),
        "runs": settings.runs,
        "cores": cluster.node_cores() if settings.on_cluster else settings.jobs,
    }
    return [
        "setpriv", "--pdeathsig", "KILL",  # it ends with this program, however that ends
        PYTHON, "-m", "snakemake",
        "--snakefile", str(paths.PAPER / "Snakefile"),
        "--directory", str(settings.results),
        *_where(settings),
        "--default-resources", *(f"{name}={value}" for name, value in DEFAULT_RESOURCES.items()),
        "--scheduler", "greedy",
        "--nolock",  # lock() does it, without stale locks after a crash
        "--rerun-incomplete",
        "--keep-going",
        *flags,
        "--config", *(f"{key}={value}" for key, value in values.items()),
    ]  # fmt: skip


def environment(results: Path) -> dict[str, str]:
    """Caches of Snakemake and matplotlib go to the results: the home may not be writable.

    What writes a date into a file takes that of SOURCE_DATE_EPOCH, not that of the day. Memory comes in huge pages,
    whose fewer page faults save the matchers and the renderer 10 to 20 % of their time on a virtual machine.
    """
    cache = results / ".cache"
    folders = {"XDG_CACHE_HOME": str(cache), "MPLCONFIGDIR": str(cache / "matplotlib")}
    defaults = {"SOURCE_DATE_EPOCH": "0", "GLIBC_TUNABLES": "glibc.malloc.hugetlb=1"}
    return {**defaults, **os.environ, **folders, MARK: str(results)}


def run_snakemake(settings: Settings, stages: list[Experiment], lock_file: int, log_name: str = "snakemake") -> bool:
    """Runs Snakemake; its own text goes to a log, progress lines to the standard output."""
    log = settings.logs / f"{log_name}.log"
    with log.open("w") as errors:
        command = _snakemake_command(settings, stages, ["--log-handler-script", PROGRESS])
        child = subprocess.Popen(
            command, stderr=errors, pass_fds=[lock_file], env=environment(settings.results)
        )
        try:
            code = child.wait()
        except KeyboardInterrupt:
            child.send_signal(signal.SIGINT)
            child.wait()  # it stops its jobs and removes what they left half-written
            raise
    if code:
        print(f"  Some stages failed; details: {log}", flush=True)
    return code == 0


def unfinished(settings: Settings, stages: list[Experiment]) -> list[str]:
    """Names of the stages that Snakemake has failed to make, or to make anew; all where it cannot say."""
    command = _snakemake_command(settings, stages, ["--summary"])
    done = subprocess.run(command, env=environment(settings.results), capture_output=True, text=True)
    lines = [line.split("\t") for line in done.stdout.splitlines()]
    finished = {fields[0] for fields in lines if fields[-1] == "no update"}
    files = {stage.name: summary.main_file(stage, Path()).as_posix() for stage in stages}
    return [name for name, file in files.items() if done.returncode or file not in finished]


def make_stages(settings: Settings, stages: list[Experiment]) -> bool:
    """Makes the stages and prints what came of it; true if nothing failed."""
    started = time.time()
    settings.logs.mkdir(parents=True, exist_ok=True)
    lock_file = lock(settings.results)
    end_leftovers(settings)
    print("== data sets", flush=True)
    make_debian_pairs(settings)
    datasets = find_datasets(settings)
    for dataset in datasets.values():
        print(f"  {dataset.name}: {dataset.scenes} scenes in {dataset.folder}", flush=True)
    obstacles = {stage.name: obstacle(stage, datasets, settings.bin) for stage in stages}
    runnable = [stage for stage in stages if not obstacles[stage.name]]
    if not runnable:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in obstacles.items())
        raise RunError(f"nothing can be made ({reasons}); see the lines above, or give --data")
    print(f"== experiments: {' '.join(stage.name for stage in runnable)}", flush=True)
    for warning in filter(None, (repeats(stage, settings.runs) for stage in runnable)):
        print(f"  {warning}", flush=True)
    passed, failed = run_in_turn(settings, runnable, obstacles, lock_file)
    print_summary(settings, stages, obstacles, failed, datasets, started)
    return passed


def run_in_turn(
    settings: Settings, runnable: list[Experiment], obstacles: dict[str, str], lock_file: int
) -> tuple[bool, list[str]]:
    """Makes all stages but reports, then these of whatever was made.

    @return whether nothing failed, and the names of the stages that did.
    """
    reports = [stage for stage in runnable if stage.kind == "report"]
    others = [stage for stage in runnable if stage.kind != "report"]
    passed = not others or run_snakemake(settings, others, lock_file)
    failed = [] if passed else unfinished(settings, others)
    write_reasons(settings, obstacles, failed)
    if reports and not run_snakemake(settings, reports, lock_file, "snakemake_report"):
        return False, failed + unfinished(settings, reports)
    return passed, failed


def write_reasons(settings: Settings, obstacles: dict[str, str], failed: list[str]) -> None:
    """Lists in results/stages.tsv what was not made and why; leaves the file alone if it says so already.

    What it says of stages that this run has nothing to do with stays.
    @param obstacles of all stages of this run; empty for those that were run. @param failed names of these.
    """
    listing = settings.results / "stages.tsv"
    reasons = {name: reason for name, reason in summary.read_reasons(listing).items() if name not in obstacles}
    now = {**obstacles, **dict.fromkeys(failed, "it failed; the run's output names the log")}
    for name, reason in now.items():
        if reason:
            there = summary.main_file(config.load_experiment(name), settings.results).exists()
            reasons[name] = reason + (f"; {summary.EARLIER}" if there else "")
    lines = "".join(f"{name}\t{reason}\n" for name, reason in sorted(reasons.items()))
    if not listing.exists() or listing.read_text() != lines:
        listing.write_text(lines)


def print_summary(
    settings: Settings,
    stages: list[Experiment],
    obstacles: dict[str, str],
    failed: list[str],
    datasets: dict[str, Dataset],
    started: float,
) -> None:
    """Ends a run: what was made, where it lies, what was measured, what was absent.

    @param obstacles why stages were left out, by name; empty for the others. @param failed names of stages.
    """
    print(f"== summary ({clock(time.time() - started)}; all files in {settings.results})")
    for stage in stages:
        if obstacles[stage.name]:
            print(f"  {stage.name:14} left out: {obstacles[stage.name]}")
        else:
            print("\n".join(summary.stage_lines(stage, settings.results, started, stage.name in failed)))
    absent = summary.absent_datasets(stages, datasets)
    print("  Data sets absent: " + ("; ".join(absent) if absent else "none"), flush=True)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="sgf_paper.run", description=__doc__)
    parser.add_argument("--bin", type=Path, required=True, help="folder of the programs")
    parser.add_argument("--results", type=Path, default=paths.PROJECT / "results")
    parser.add_argument("--generated", type=Path, default=paths.PROJECT / "datasets" / "generated")
    parser.add_argument("--data", default=os.environ.get("SGF_DATA", ""), help="downloaded data sets")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="parallel jobs")
    parser.add_argument("--cluster", choices=["slurm"], help="submit each job; --jobs at a time")
    parser.add_argument("--full", action="store_true", help="full suites of sequences, not short ones")
    parser.add_argument("--runs", type=int, default=0, help="of experiments that repeat runs")
    parser.add_argument("stages", nargs="+", help="names of experiments")
    return parser.parse_args()


def _interrupt(*_: object) -> NoReturn:
    raise KeyboardInterrupt


def main() -> int:
    arguments = parse_arguments()
    signal.signal(signal.SIGTERM, _interrupt)
    settings = Settings(
        bin=arguments.bin.resolve(),
        results=arguments.results.resolve(),
        data=str(Path(arguments.data).resolve()) if arguments.data else "",
        generated=arguments.generated.resolve(),
        jobs=arguments.jobs,
        full=arguments.full,
        runs=arguments.runs,
        on_cluster=arguments.cluster is not None,
    )
    try:
        stages = [config.load_experiment(name) for name in arguments.stages]
        return 0 if make_stages(settings, stages) else 1
    except (RunError, cluster.ClusterError, ConfigError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("Interrupted; the same command goes on from here.", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
