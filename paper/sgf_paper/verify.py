"""Repeats a sample of the runs that were recorded and compares what they make: `./reproduce.sh --verify`.

One run of each rule is drawn, as many as fit into the time. A run is repeated in a folder of its own, which shows
it the results as they lie there. If code, inputs, packages, processor and build are those on record, its files
have to be the same bits; if not, what differs is said, and numbers have to agree within paper/tolerances.yaml.
Pictures and documents have other bits then and no numbers: of a run that makes no more, nothing is compared.
Exit code 0 if all that was compared agrees, 1 if anything does not or nothing was there to repeat or to compare.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from sgf_paper import paths, record
from sgf_paper import run as run_module
from sgf_paper.progress import clock
from sgf_paper.strict_yaml import ConfigError, read_yaml

CONDITIONS = ("code", "inputs", "packages", "processor", "build")
TIMED = re.compile(r"timings?\b|_timings\.|bench_")  # files that say how long something took
# Files that are made of what is compared elsewhere, or that say what a run was told.
WITHOUT_VALUES = re.compile(r".*\.(png|pdf|ply|pfm|md|tex|html)|(.*\.)?options\.yaml")
CONDITIONS_IN_YAML = ("build", "data", "optuna")  # keys that say what a file was made with
NOTHING = "nothing to compare"
TOLERANCES = paths.PAPER / "tolerances.yaml"
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class Tolerance:
    files: str
    absolute: float
    relative: float
    columns: str = ""

    def fits(self, file: str, column: str) -> bool:
        return fnmatchcase(file, self.files) and bool(re.fullmatch(self.columns, column) or not self.columns)

    def allows(self, a: float, b: float) -> bool:
        return abs(a - b) <= max(self.absolute, self.relative * max(abs(a), abs(b)))


@dataclass(frozen=True)
class Recorded:
    """A run on record."""

    folder: Path
    node: dict[str, Any]
    wall_s: float

    @property
    def rule(self) -> str:
        return self.node["rule"]

    @property
    def compared(self) -> list[str]:
        """What it made, but for files that are about time."""
        return [name for name in self.node.get("outputs", {}) if not TIMED.search(Path(name).name)]

    @property
    def valued(self) -> list[str]:
        """Those of the files compared that hold values."""
        return [name for name in self.compared if not WITHOUT_VALUES.fullmatch(Path(name).name)]


def load_tolerances() -> list[Tolerance]:
    return [Tolerance(**node) for node in read_yaml(TOLERANCES)["tolerances"]]


# --- the sample -----------------------------------------------------------------------------------


def find_recorded(results: Path) -> list[Recorded]:
    """All runs that ended well and left something to compare, in order of their folders."""
    found = []
    for file in sorted(path for top in ("raw", "runs") for path in (results / top).rglob("run.json")):
        timing = file.with_name("timing.json")
        node = json.loads(file.read_text())
        if node["exit"]["state"] == "done" and timing.exists():
            found.append(Recorded(file.parent, node, json.loads(timing.read_text())["wall_s"]))
    return [run for run in found if run.compared]


def is_repeatable(run: Recorded, results: Path) -> bool:
    """Whether all that it read is still there; rawlogs, which are copies of images, are removed after a run."""
    reads_rawlog = any(word.endswith(".rawlog") for word in run.node["command"])
    return not reads_rawlog and all((results / name).exists() for name in run.node["inputs"])


def draw_sample(runs: list[Recorded], seed: int, seconds: float) -> list[Recorded]:
    """One run of each rule, drawn among those that take no longer than what is left of the time."""
    generator = random.Random(seed)
    rules = sorted({run.rule for run in runs})
    generator.shuffle(rules)
    sample = []
    for rule in rules:
        fitting = [run for run in runs if run.rule == rule and run.wall_s <= seconds]
        if fitting:
            sample.append(generator.choice(fitting))
            seconds -= sample[-1].wall_s
    return sorted(sample, key=lambda run: run.rule)


# --- the repetition -------------------------------------------------------------------------------


def show_results(results: Path, shown: Path, outputs: list[Path]) -> None:
    """Fills a folder with what is in the results but for some outputs.

    Folders that outputs go to are copied, and with them the files beside the outputs; all else is linked. A
    database of trials is not among them: a search that finds its trials done would repeat none of them.
    """
    shown.mkdir(exist_ok=True)
    for path in results.iterdir():
        below = [output for output in outputs if path == output or path in output.parents]
        if path.name == ".cache" or path.suffix == ".db" or path in outputs:
            continue
        if below and path.is_dir():
            show_results(path, shown / path.name, below)
        elif path.is_file():
            shutil.copy2(path, shown / path.name)
        else:
            (shown / path.name).symlink_to(path)


def repeat(run: Recorded, results: Path, scratch: Path) -> int:
    """Runs its command again, with `scratch` in place of the results; what it says goes to log.txt there."""
    outputs = [results / name for name in run.node["outputs"]]
    show_results(results, scratch, outputs)
    for output in run.node["outputs"]:
        (scratch / output).parent.mkdir(parents=True, exist_ok=True)
    environment = {**run_module.environment(results), "PYTHONPATH": str(paths.PAPER)}
    with (scratch / "log.txt").open("w") as log:
        done = subprocess.run(run.node["command"], cwd=scratch, env=environment, stdout=log, stderr=log)
    return done.returncode


def changed_conditions(run: Recorded, results: Path) -> list[str]:
    """Which of the conditions on record are others now."""
    here = Path.cwd()
    os.chdir(results)  # inputs are on record by their paths from there
    try:
        inputs = [Path(name) for name in run.node["inputs"]]
        now = record.conditions(inputs)
    finally:
        os.chdir(here)
    return [name for name in CONDITIONS if now[name] != run.node[name]]


# --- the comparison -------------------------------------------------------------------------------


def _flatten(node: Any, name: str = "") -> list[tuple[str, str]]:
    """The values of a JSON or YAML file with their dotted keys; items of lists have their list's."""
    if isinstance(node, dict):
        return [pair for key, value in node.items() for pair in _flatten(value, f"{name}.{key}".strip("."))]
    if isinstance(node, list):
        return [pair for value in node for pair in _flatten(value, name)]
    return [(name, str(node))]


def read_values(path: Path) -> list[tuple[str, str]]:
    """The values in a file with the names of their columns or keys, if it has such."""
    text = path.read_text()
    if path.suffix == ".json":
        return _flatten(json.loads(text))
    if path.suffix == ".yaml":
        node = read_yaml(path)
        return _flatten({key: value for key, value in node.items() if key not in CONDITIONS_IN_YAML})
    if path.suffix == ".csv":
        header, *lines = list(csv.reader(text.splitlines())) or [[]]
        return [pair for line in lines for pair in zip(header, line)] + [("", name) for name in header]
    return [("", word) for word in text.split()]


def agree(file: str, name: str, a: str, b: str, tolerances: list[Tolerance]) -> bool:
    """Whether two values agree: as text, or as numbers within the first tolerance that fits."""
    if a == b:
        return True
    if not (NUMBER.fullmatch(a) and NUMBER.fullmatch(b)):
        return False
    fitting = next((t for t in tolerances if t.fits(file, name)), None)
    return fitting is not None and fitting.allows(float(a), float(b))


def differences(file: str, old: Path, new: Path, tolerances: list[Tolerance]) -> str:
    """What tells two files apart beyond the tolerances; empty if nothing does."""
    try:
        before, after = read_values(old), read_values(new)
    except (ValueError, ConfigError) as error:
        return f"{file}: cannot be read: {error}"
    if len(before) != len(after):
        return f"{file}: {len(after)} values in place of {len(before)}"
    for (name, a), (_, b) in zip(before, after):
        if not agree(file, name, a, b, tolerances):
            return f"{file}: {name} {b} in place of {a}".replace("  ", " ")
    return ""


def compare(run: Recorded, results: Path, scratch: Path, changed: list[str]) -> tuple[str, str]:
    """How a repeated run compares: a word, and what differs."""
    cache = results / ".cache" / "hashes"
    lost = [name for name in run.compared if not (scratch / name).exists()]
    if lost:
        return "DIFFERS", f"{lost[0]} was not made"
    other = [name for name in run.compared if record.hash_path(scratch / name, cache) != run.node["outputs"][name]]
    if not other:
        return "same bits", ""
    if not changed:
        return "DIFFERS", f"other bits: {', '.join(other[:3])}"
    if not run.valued:
        return NOTHING, f"other bits: {', '.join(other[:3])}"
    unlike = [name for name in run.valued if name in other]
    gone = [name for name in unlike if not (results / name).exists()]
    if gone:
        return "DIFFERS", f"{gone[0]} is gone from the results"
    tolerances = load_tolerances()
    texts = [differences(name, results / name, scratch / name, tolerances) for name in unlike]
    found = next(filter(None, texts), "")
    return ("DIFFERS", found) if found else ("within tolerances", "")


def verify_run(run: Recorded, results: Path) -> tuple[str, str]:
    """Repeats a run and compares it."""
    changed = changed_conditions(run, results)
    work = results / ".cache" / "verify"
    work.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=work) as scratch:
        code = repeat(run, results, Path(scratch))
        if code:
            lines = (Path(scratch) / "log.txt").read_text().splitlines() or ["no message"]
            return "DIFFERS", f"exit code {code}: {lines[-1]}"
        word, what = compare(run, results, Path(scratch), changed)
    return word, "; ".join(filter(None, [what, f"other {', '.join(changed)}" if changed else ""]))


def verify(results: Path, seed: int, minutes: float) -> bool:
    """Repeats a sample and prints a line for each run; whether all agree that could be compared, and any could.

    @throws RunError if there is nothing to repeat, or while another run is at work.
    """
    if results.is_dir():
        run_module.lock(results)
    runs = [run for run in find_recorded(results) if is_repeatable(run, results)]
    sample = draw_sample(runs, seed, 60 * minutes)
    if not sample:
        raise run_module.RunError(f"no finished run in {results} can be repeated; run ./reproduce.sh first")
    print(f"== verify: {len(sample)} of {len(runs)} runs, seed {seed}", flush=True)
    words = set()
    for run in sample:
        word, what = verify_run(run, results)
        words.add(word)
        name = run.folder.relative_to(results)
        print(f"  {run.rule:18} {word:18} {clock(run.wall_s):>7}  {name}{f' ({what})' if what else ''}", flush=True)
    left = sorted({run.rule for run in runs} - {run.rule for run in sample})
    print(f"  Left out, as they take longer: {', '.join(left) or 'none'}", flush=True)
    return "DIFFERS" not in words and words != {NOTHING}


def main() -> int:
    parser = argparse.ArgumentParser(prog="sgf_paper.verify", description=__doc__)
    parser.add_argument("--results", type=Path, default=paths.PROJECT / "results")
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument("--minutes", type=float, default=10, help="that the runs took when they were recorded")
    arguments = parser.parse_args()
    try:
        return 0 if verify(arguments.results.resolve(), arguments.seed, arguments.minutes) else 1
    except (run_module.RunError, ConfigError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("Interrupted.", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
