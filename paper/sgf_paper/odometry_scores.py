"""Scores of the odometry runs that begin at the same frame of a sequence.

A run that has poses for too few frames is lost and has no errors. The others are scored by sgf_eval at
the times that all of them have a pose at, so that their errors are of the same frames. Where the
experiment asks whether runs succeed, they are scored on all of their own poses as well.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sgf_paper import config
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.tracking_config import RepeatedRuns

if TYPE_CHECKING:
    import pandas as pd

# What sgf_eval calls the errors that are kept, at common times and of all poses of a run.
ERRORS = {
    "ate_rmse_m": "ate_m",
    "ate_mean_m": "ate_mean_m",
    "rpe_half_second.translation_m": "rpe_half_second_m",
    "rpe_one_second.translation_m": "rpe_one_second_m",
    "rpe_one_second.rotation_deg": "rpe_one_second_deg",
    "orientation_rmse_deg": "orientation_deg",
}
OWN_SCORES = {
    "path_m": "path_m",
    "ate_rmse_m": "own_ate_m",
    "ate_median_m": "own_ate_median_m",
    "ate_max_m": "own_ate_max_m",
    "scale_error_median_m": "scale_error_median_m",
    "scale_error_max_m": "scale_error_max_m",
    "success_by_scale": "success_by_scale",
    "success_by_ate": "success_by_ate",
}
COUNTS = ["frames", "posed", "lost", "clipped_pct", "compared"]
COLUMNS = ["condition", "column", *COUNTS, *ERRORS.values()]


class ScoresError(Exception):
    """A run that cannot be scored."""


@dataclass(frozen=True)
class Run:
    """A folder that a program wrote."""

    condition: str
    column: str
    trajectory: Path
    frames: int
    posed: int
    clipped_pct: float
    lost: bool


def read_run(study: RepeatedRuns, runs: Path, condition: str, column: str) -> Run:
    """Reads what the program says of a run."""
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


def evaluate(command: list[Any]) -> None:
    """Runs sgf_eval, which names its mistakes on the standard error. @throws ScoresError if it fails."""
    done = subprocess.run(command, stdout=subprocess.DEVNULL)
    if done.returncode:
        raise ScoresError(f"{command[2]}: sgf_eval cannot score it (exit code {done.returncode})")


@dataclass(frozen=True)
class Scorer:
    """sgf_eval on the trajectories of one sequence."""

    study: RepeatedRuns
    program: Path
    folder: Path  # of the sequence

    def _evaluate(self, run: Run, others: list[Run], wanted: dict[str, str]) -> dict[str, Any]:
        """The wanted scores of a run at the times that the others have too, and how many those are."""
        with tempfile.NamedTemporaryFile(suffix=".json") as out:
            command = [self.program, "trajectory", run.trajectory, "--sequence", self.folder]
            command += [*self.study.score_flags(run.column), "--out", out.name]
            common = ["--common", *(other.trajectory for other in others)] if others else []
            evaluate([*command, *common])
            scores = json.loads(Path(out.name).read_text())
        if any(scores[name] is None for name in wanted):
            raise ScoresError(f"{run.trajectory}: {scores['poses']} common poses are too few for errors")
        return {"compared": scores["poses"], **{name: scores[key] for key, name in wanted.items()}}

    def own_scores(self, run: Run) -> dict[str, Any]:
        """Scores of a run on all of its own poses."""
        return self._evaluate(run, [], OWN_SCORES)

    def scores(self, run: Run, kept: list[Run]) -> dict[str, Any]:
        """Scores of a run at the times that all runs kept have, and where wanted on its own poses."""
        own = self.own_scores(run) if self.study.SCORES_OWN else {}
        return own | self._evaluate(run, [other for other in kept if other is not run], ERRORS)


def columns_of(study: RepeatedRuns) -> list[str]:
    """What a line of an experiment's scores has."""
    return [*COLUMNS, *(OWN_SCORES.values() if study.SCORES_OWN else [])]


def score(study: RepeatedRuns, sequence: str, folder: Path, runs: Path, program: Path) -> pd.DataFrame:
    """A line per condition and column; lost runs have no errors.

    @param folder of the sequence. @param program sgf_eval.
    @param runs folder with a folder per condition, in it one per column.
    """
    import pandas as pd  # late: what imports this module for the rest need not wait for it

    scorer = Scorer(study, program, folder)
    every = [
        read_run(study, runs, condition, column)
        for condition in study.conditions_of(sequence)
        for column in study.columns
    ]
    kept = [run for run in every if not run.lost]
    columns = columns_of(study)
    lines = []
    for run in every:
        line = {name: getattr(run, name) for name in columns if hasattr(run, name)}
        lines.append(line | ({} if run.lost else scorer.scores(run, kept)))
    return pd.DataFrame(lines, columns=columns)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("sequence", help="its name in the experiment")
    parser.add_argument("--folder", type=Path, required=True, help="of the sequence")
    parser.add_argument("--program", type=Path, required=True, help="sgf_eval")
    parser.add_argument("--runs", type=Path, required=True, help="folder of the runs")
    parser.add_argument("--out", type=Path, required=True, help="CSV file to write")
    a = parser.parse_args()
    try:
        table = score(config.load_experiment(a.name), a.sequence, a.folder, a.runs, a.program)
    except (ScoresError, ConfigError) as error:
        raise SystemExit(f"Error: {error}") from None
    table.to_csv(a.out, index=False)


if __name__ == "__main__":
    main()
