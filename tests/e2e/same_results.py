#!/usr/bin/python3
"""Makes experiments again with the real programs, but disturbed, and compares tables and figures byte for byte.

    tests/e2e/same_results.py kills 10 table1 odometry   # killed ten times at random moments, then left to end
    tests/e2e/same_results.py slurm table1 odometry      # on a Slurm cluster of this machine alone; takes root

For a clone in which ./reproduce.sh has made these experiments undisturbed, without --full and --runs, with SGF_DATA as
now. Its results lie in build/undisturbed_results meanwhile and are put back at the end, however it ends; after a
SIGKILL, by the next call. What was made in their place is left in build/disturbed_results. Rendered data sets stay.
What says how long something took is not compared: *_timings.csv and the benchmark's tables. Ends with 0 if all else is
the same, with 1 if not, or if a run fails.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(PROJECT / "paper"))

from sgf_paper import file_lock, paths, verify  # noqa: E402

RESULTS = PROJECT / "results"
UNDISTURBED = PROJECT / "build" / "undisturbed_results"
DISTURBED = PROJECT / "build" / "disturbed_results"
LOCK = PROJECT / "build" / "same_results.lock"
KEPT = ("reference", "external")  # what a run finds in its results
EXPERIMENTS = sorted(path.stem for path in paths.EXPERIMENTS.glob("*.yaml"))


# --- the comparison -------------------------------------------------------------------------------


def tables_and_figures(results: Path) -> list[Path]:
    return [path for folder in ("tables", "figures") for path in sorted((results / folder).glob("*"))]


def made(results: Path) -> dict[str, bytes]:
    """The bytes of all tables and figures, but for those that say how long something took."""
    files = [path for path in tables_and_figures(results) if not verify.TIMED.search(path.name)]
    return {str(path.relative_to(results)): path.read_bytes() for path in files}


def experiment_of(file: str) -> str:
    """The experiment that makes a table or figure: the longest name that its own begins with."""
    fitting = [name for name in EXPERIMENTS if re.match(rf"{name}[._]", Path(file).name)]
    return max(fitting, key=len, default="")


def differing(before: dict[str, bytes], after: dict[str, bytes], names: list[str]) -> list[str]:
    """What is not the same of all that was made now, and was made before by these experiments."""
    files = {file for file in before if experiment_of(file) in names} | set(after)
    return sorted(file for file in files if before.get(file) != after.get(file))


# --- the results in another place -----------------------------------------------------------------


def put_back() -> None:
    """Puts undisturbed results back where they belong, if they are elsewhere."""
    if UNDISTURBED.exists():
        if RESULTS.exists():
            shutil.rmtree(DISTURBED, ignore_errors=True)
            RESULTS.rename(DISTURBED)
        UNDISTURBED.rename(RESULTS)


@contextlib.contextmanager
def new_results() -> Iterator[None]:
    """Has results made in a new folder."""
    RESULTS.rename(UNDISTURBED)
    try:
        RESULTS.mkdir()
        for name in KEPT:
            if (UNDISTURBED / name).exists():
                shutil.copytree(UNDISTURBED / name, RESULTS / name)
        yield
    finally:
        put_back()


# --- disturbed runs -------------------------------------------------------------------------------


def end(process: subprocess.Popen, whole_group: bool) -> None:
    """Kills reproduce.sh alone, or with all that it has started; what is left can go on printing."""
    (os.killpg if whole_group else os.kill)(process.pid, signal.SIGKILL)
    process.wait(timeout=60)


@contextlib.contextmanager
def running(*arguments: str, **environment: str) -> Iterator[subprocess.Popen]:
    """reproduce.sh as the leader of its own process group, which does not outlive an error here."""
    command = [PROJECT / "reproduce.sh", *arguments]
    process = subprocess.Popen(command, env={**os.environ, **environment}, start_new_session=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            end(process, whole_group=True)


def run_with_kills(arguments: argparse.Namespace) -> bool:
    """Kills a run again and again, in turn with all that it has started and alone; whether it then ends well.

    A run that ends before the first kill was not disturbed, which is a failure here.
    """
    generator = random.Random(arguments.seed)
    for index in range(arguments.number):
        moment, whole_group = generator.uniform(0, arguments.within), index % 2 == 0
        with running("--only", *arguments.names) as process:
            try:
                process.wait(timeout=moment)
            except subprocess.TimeoutExpired:
                end(process, whole_group)
            else:
                print(f"== it ended before kill {index + 1}, after less than {moment:.1f} s (see --within)", flush=True)
                return index > 0 and process.returncode == 0
        what = "with all that it had started" if whole_group else "alone"
        print(f"== killed after {moment:.1f} s, {what}: {index + 1} of {arguments.number}", flush=True)
    with running("--only", *arguments.names) as process:
        return process.wait() == 0


def run_on_slurm(arguments: argparse.Namespace) -> bool:
    """Whether a run on a cluster of this machine alone ends well."""
    cluster = HERE / "one_node_slurm.sh"
    with tempfile.TemporaryDirectory() as folder:
        try:
            subprocess.run([cluster, "up", folder], check=True)
            flags = ("--cluster", "slurm", "--only", *arguments.names)
            with running(*flags, SLURM_CONF=f"{folder}/slurm.conf") as process:
                return process.wait() == 0
        except subprocess.CalledProcessError:
            return False  # it has said why
        finally:
            subprocess.run([cluster, "down", folder], check=False)


# --- command line ---------------------------------------------------------------------------------


def prepare(names: list[str]) -> str:
    """Sees to it that nothing else is at work here; what stands in the way, if anything does."""
    UNDISTURBED.parent.mkdir(exist_ok=True)
    if file_lock.take(LOCK, 0) is None:
        return f"another {Path(__file__).name} is at work here"
    put_back()
    absent = set(names) - {experiment_of(path.name) for path in tables_and_figures(RESULTS)}
    if absent:
        return f"not made in {RESULTS}: {', '.join(sorted(absent))}"
    return f"a run is at work in {RESULTS}" if file_lock.take(RESULTS / ".lock", 0) is None else ""


def same_results(arguments: argparse.Namespace) -> bool:
    """Makes the experiments disturbed; whether all is the same, and prints what is not."""
    if obstacle := prepare(arguments.names):
        print(f"Error: {obstacle}", file=sys.stderr)
        return False
    before = made(RESULTS)
    with new_results():
        passed = arguments.run(arguments)
        after = made(RESULTS)
    if not passed:
        print("Error: the disturbed run failed", file=sys.stderr)
        return False
    files = differing(before, after, arguments.names)
    for file in files:
        print(f"DIFFERS: {file}")
    print(f"{len(after)} files were made, {len(files)} differ; those of the disturbed run: {DISTURBED}")
    return not files


def parse_arguments() -> argparse.Namespace:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="same_results.py", description=__doc__, formatter_class=form)
    ways = parser.add_subparsers(required=True, metavar="kills|slurm")
    kills = ways.add_parser("kills", help="kill the run at random moments")
    kills.set_defaults(run=run_with_kills)
    kills.add_argument("number", type=int, help="of kills")
    kills.add_argument("--within", type=float, default=60, help="seconds from a start to the next kill, at most")
    kills.add_argument("--seed", type=int, default=1, help="of the moments")
    slurm = ways.add_parser("slurm", help="run on a cluster of this machine alone")
    slurm.set_defaults(run=run_on_slurm)
    for way in (kills, slurm):
        way.add_argument("names", nargs="+", metavar="NAME", choices=EXPERIMENTS, help="of experiments")
    return parser.parse_args()


def main() -> int:
    arguments = parse_arguments()
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda received, _: sys.exit(128 + received))
    return 0 if same_results(arguments) else 1


if __name__ == "__main__":
    sys.exit(main())
