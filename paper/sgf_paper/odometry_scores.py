"""Scores of the odometry runs that begin at the same frame of a sequence.

A run that has poses for too few frames is lost and has no errors. The others are scored by sgf_eval at
the times that all of them have a pose at, so that their errors are of the same frames.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from sgf_paper import config
from sgf_paper.config import Odometry

# What sgf_eval calls the errors that are kept.
ERRORS = {
    "ate_rmse_m": "ate_m",
    "rpe_half_second.translation_m": "rpe_half_second_m",
    "rpe_one_second.translation_m": "rpe_one_second_m",
    "rpe_one_second.rotation_deg": "rpe_one_second_deg",
    "orientation_rmse_deg": "orientation_deg",
}
COUNTS = ["frames", "posed", "lost", "clipped_pct", "compared"]
COLUMNS = ["condition", "column", *COUNTS, *ERRORS.values()]


class ScoresError(Exception):
    """A run that cannot be scored."""


@dataclass(frozen=True)
class Run:
    """A folder that sgf_align wrote."""

    condition: str
    column: str
    trajectory: Path
    frames: int
    posed: int
    clipped_pct: float
    lost: bool


def read_run(study: Odometry, runs: Path, condition: str, column: str) -> Run:
    """Reads what sgf_align says of a run."""
    folder = runs / condition / column
    summary = json.loads((folder / "summary.json").read_text())
    frames, posed = summary["frames"], summary["posed"]
    return Run(
        condition,
        column,
        folder / "trajectory.txt",
        frames,
        posed,
        100 * summary["clipped_share"],
        lost=100 * posed < study.lost_below_pct * frames,
    )


def _errors(run: Run, kept: list[Run], program: Path, sequence: Path) -> dict[str, float]:
    """Errors of a run at the times that all runs kept have."""
    others = [str(other.trajectory) for other in kept if other is not run]
    with tempfile.NamedTemporaryFile(suffix=".json") as out:
        command = [program, "trajectory", run.trajectory, "--sequence", sequence, "--out", out.name]
        subprocess.run([*command, *(["--common", *others] if others else [])], check=True)
        scores = json.loads(Path(out.name).read_text())
    if any(scores[name] is None for name in ERRORS):
        raise ScoresError(f"{run.trajectory}: {scores['poses']} common poses are too few for errors")
    return {"compared": scores["poses"], **{name: scores[key] for key, name in ERRORS.items()}}


def score(study: Odometry, runs: Path, program: Path, sequence: Path) -> pd.DataFrame:
    """A line per condition and column; lost runs have no errors.

    @param runs folder with a folder per condition, in it one per column. @param program sgf_eval.
    """
    every = [
        read_run(study, runs, condition, column)
        for condition in study.conditions
        for column in study.columns
    ]
    kept = [run for run in every if not run.lost]
    lines = []
    for run in every:
        line = {name: getattr(run, name) for name in COLUMNS if hasattr(run, name)}
        lines.append(line | ({} if run.lost else _errors(run, kept, program, sequence)))
    return pd.DataFrame(lines, columns=COLUMNS)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--program", type=Path, required=True, help="sgf_eval")
    parser.add_argument("--sequence", type=Path, required=True, help="folder of the sequence")
    parser.add_argument("--runs", type=Path, required=True, help="folder of the runs")
    parser.add_argument("--out", type=Path, required=True, help="CSV file to write")
    a = parser.parse_args()
    score(config.load_experiment(a.name), a.runs, a.program, a.sequence).to_csv(a.out, index=False)


if __name__ == "__main__":
    main()
