"""Trajectories of other systems, scored as our own: results/external/<system>/<sequence>.txt or .csv.

A .txt file is in TUM's format, a .csv file in that of EuRoC's ground truth. Times are kept digit by digit.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

from sgf_paper import config, odometry_scores
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.tracking_config import JoinedTable, TableSequence, image_times_ns, load_external_system

SUFFIXES = (".txt", ".csv")
NS = 10**9
TOLERANCE_NS = 1000  # to which sgf_eval compares times
LAST_S = 2**63 // NS  # that 64 bits of nanoseconds hold
MAX_NORM_ERROR = 1e-3  # that sgf_eval takes
# Fields of a pose in the order of TUM's format: tx ty tz qx qy qz qw.
TUM_FIELDS = [1, 2, 3, 4, 5, 6, 7]
EUROC_FIELDS = [1, 2, 3, 5, 6, 7, 4]
KEPT = [
    "path_m",
    "ate_mean_m",
    "ate_rmse_m",
    "rpe_one_second.translation_m",
    "coverage_pct",
    "success_by_scale",
]


class ExternalError(Exception):
    """A file that cannot be scored; the text names it, and the line where there is one."""


@dataclass(frozen=True)
class Pose:
    time_ns: int
    numbers: list[float]  # tx ty tz qx qy qz qw


def find_files(folder: Path) -> dict[tuple[str, str], list[Path]]:
    """The files by system and sequence: one of each, unless there is a mistake."""
    found: dict[tuple[str, str], list[Path]] = {}
    for path in sorted(folder.glob("*/*")):
        if path.suffix in SUFFIXES:
            found.setdefault((path.parent.name, path.stem), []).append(path)
    return found


def _time_ns(text: str, is_csv: bool) -> int:
    """Exact: a float has too few digits for times since 1970."""
    try:
        time_s = Decimal(int(text)).scaleb(-9) if is_csv else Decimal(text)
    except (ValueError, InvalidOperation):
        time_s = Decimal("nan")
    if not time_s.is_finite():
        raise ValueError(f"the time '{text}' is no number of {'whole nanoseconds' if is_csv else 'seconds'}")
    if time_s.copy_abs() > LAST_S:  # abs() would round, which such a time may not survive
        raise ValueError(f"the time '{text}' is no time: 64 bits of nanoseconds do not hold it")
    return int((time_s * NS).to_integral_value())


def _number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"'{text}' is no finite number")
    return number


def _pose(line: str, is_csv: bool) -> Pose:
    """@throws ValueError saying what is wrong."""
    fields = [field.strip() for field in line.split(",")] if is_csv else line.split()
    if len(fields) < 8 or (len(fields) > 8 and not is_csv):
        raise ValueError(f"has {len(fields)} fields, and a pose takes 8{' or more' if is_csv else ''}")
    time_ns = _time_ns(fields[0], is_csv)
    numbers = [_number(fields[i]) for i in (EUROC_FIELDS if is_csv else TUM_FIELDS)]
    norm = math.hypot(*numbers[3:])
    if abs(norm - 1) > MAX_NORM_ERROR:
        raise ValueError(f"the quaternion's norm is {norm:.4g}")
    return Pose(time_ns, numbers)


def read_poses(path: Path) -> list[Pose]:
    """Reads a file of poses of increasing times; '#' begins a comment."""
    poses: list[Pose] = []
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        line = line.split("#")[0].strip()
        if not line:
            continue
        try:
            pose = _pose(line, path.suffix == ".csv")
        except ValueError as error:
            raise ExternalError(f"{path}:{number}: {error}") from None
        if pose.time_ns <= (poses[-1].time_ns if poses else -1):
            raise ExternalError(
                f"{path}:{number}: the time {pose.time_ns} ns does not come after the one before"
            )
        poses.append(pose)
    if not poses:
        raise ExternalError(f"{path}: has no poses")
    return poses


def write_tum(poses: list[Pose], path: Path) -> None:
    """Writes poses for sgf_eval, which gets the numbers that were read."""
    lines = [f"{p.time_ns // NS}.{p.time_ns % NS:09} {' '.join(map(repr, p.numbers))}\n" for p in poses]
    path.write_text("".join(lines))


def candidates(joined: JoinedTable, name: str, data: str) -> list[TableSequence]:
    """Sequences at hand that a file of this name may be of: real ones, cuts of them, and rendered ones."""
    return [s for s in joined.sequences if s.euroc_name == name and s.at_hand(data)]


def is_left_out(joined: JoinedTable, name: str, data: str) -> bool:
    """Whether a file is of a sequence that is not at hand; a name of no sequence is a mistake instead."""
    known = any(sequence.euroc_name == name for sequence in joined.sequences)
    return known and not candidates(joined, name, data)


def check_names(joined: JoinedTable, path: Path, files: list[Path]) -> None:
    """Finds mistakes in what a file and its folder are called."""
    if len(files) > 1:
        raise ExternalError(f"{path.parent}: both {files[0].name} and {files[1].name}; one of them has to go")
    own = [f"{prefix}_{column}" for prefix, part in joined.parts.items() for column in part.columns]
    if path.parent.name in own:
        raise ExternalError(
            f"{path.parent}: {path.parent.name} is a system of our own; the folder needs another name"
        )
    known = dict.fromkeys(sequence.euroc_name for sequence in joined.sequences)
    if path.stem not in known:
        raise ExternalError(f"{path}: no sequence is called {path.stem}; known: {', '.join(known)}")


@dataclass(frozen=True)
class Scorer:
    """sgf_eval on the sequences at hand."""

    joined: JoinedTable
    program: Path
    suite: Path  # folder of the rendered sequences
    data: str

    def _sequence(self, path: Path, poses: list[Pose]) -> tuple[TableSequence, list[Pose]]:
        """The sequence whose images were taken when the poses were, and the poses of that time."""
        spans = []
        for sequence in candidates(self.joined, path.stem, self.data):
            times = image_times_ns(sequence.path(self.suite, self.data))
            first, last = times[0] - TOLERANCE_NS, times[-1] + TOLERANCE_NS
            inside = [pose for pose in poses if first <= pose.time_ns <= last]
            if inside:
                return sequence, inside
            spans.append(f"{times[0]} to {times[-1]} ns ({sequence.dataset})")
        raise ExternalError(f"{path}: no pose is of the time of {path.stem}: {', '.join(spans)}")

    def score(self, path: Path) -> dict[str, object]:
        """A line of scores of a file."""
        how = load_external_system(path.parent)
        sequence, poses = self._sequence(path, read_poses(path))
        with tempfile.TemporaryDirectory() as work:
            estimate, out = Path(work) / "estimate.txt", Path(work) / "scores.json"
            write_tum(poses, estimate)
            command = [
                self.program,
                "trajectory",
                estimate,
                "--sequence",
                sequence.path(self.suite, self.data),
            ]
            command += ["--frame", how.frame, "--align", how.align, "--out", out]
            odometry_scores.evaluate(command)
            scores = json.loads(out.read_text())
        where = {"system": path.parent.name, "dataset": sequence.dataset, "sequence": path.stem}
        return where | {name: scores[name] for name in KEPT}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="joined table of paper/experiments")
    parser.add_argument("files", type=Path, nargs="+", help="the trajectory; more than one is a mistake")
    parser.add_argument("--program", type=Path, required=True, help="sgf_eval")
    parser.add_argument("--suite", type=Path, required=True, help="folder of the rendered sequences")
    parser.add_argument("--data", default="", help="folder with downloaded data sets")
    parser.add_argument("--out", type=Path, required=True, help="CSV file to write")
    a = parser.parse_args()
    joined, path = config.load_experiment(a.name), a.files[0]
    try:
        check_names(joined, path, a.files)
        line = Scorer(joined, a.program, a.suite, a.data).score(path)
    except (ExternalError, odometry_scores.ScoresError, ConfigError) as error:
        raise SystemExit(f"Error: {error}") from None
    import pandas as pd  # late: the Snakefile, which imports this module, need not wait for it

    pd.DataFrame([line]).to_csv(a.out, index=False)


if __name__ == "__main__":
    main()
