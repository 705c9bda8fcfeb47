"""What reports on repeated runs share: the scores of all runs, and the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from sgf_paper import text
from sgf_paper.tracking_config import RepeatedRuns

KEYS = ["sequence", "condition", "column"]
ALL = "all"  # in place of a sequence: all of them together
LENGTHS = ["ate", "ate_mean", "rpe_half_second", "rpe_one_second"]


def read_scores(study: RepeatedRuns, raw: Path, sequences: list[str], runs: int) -> pd.DataFrame:
    """The lines of all scores with sequence, run and its first frame; errors in mm and degrees."""
    frames = []
    for sequence in sequences:
        for run in range(runs):
            frame = pd.read_csv(raw / sequence / f"run_{run}" / "scores.csv")
            where = {"sequence": sequence, "run": run, "first_frame": study.first_frame(run)}
            frames.append(frame.assign(**where))
    table = pd.concat(frames, ignore_index=True)
    for name in LENGTHS:
        table[f"{name}_mm"] = 1000 * table.pop(f"{name}_m")
    return table.astype({"compared": "Int64"})


def posed_pct(lines: pd.DataFrame) -> pd.Series:
    """The share of its frames that each run has a pose for."""
    return 100 * lines["posed"] / lines["frames"]


def ratio_rows(compared: pd.DataFrame) -> list[dict]:
    """Comparisons of errors as text."""
    return [
        {**line._asdict(), "ratio": text.format_estimate(line.ratio, line.ratio_low, line.ratio_high, 2)}
        for line in compared.itertuples()
    ]


def document_context(study: RepeatedRuns, sequences: list[str], runs: int) -> dict[str, Any]:
    """What the templates of all reports need. @param sequences names of those that were run."""
    return {
        "study": study,
        "runs": runs,
        "sequences": {name: study.sequences[name] for name in sequences},
        "absent": [name for name in study.sequences if name not in sequences],
    }


def write_csvs(name: str, tables: Path, frames: dict[str, pd.DataFrame]) -> None:
    """Writes <name><end>.csv of each frame, given by its end."""
    for end, frame in frames.items():
        text.write_csv(frame, tables / f"{name}{end}.csv")


def run_report(description: str, make: Callable[[str, Path, list[str], int, Path, Path], None]) -> None:
    """The command line of a report, which `make` makes of what it says."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="folder of the scores of its runs")
    parser.add_argument("--sequences", nargs="+", required=True, help="names of those that were run")
    parser.add_argument("--runs", type=int, required=True, help="number of runs of each column")
    parser.add_argument("--tables", type=Path, required=True, help="folder for the tables")
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figure")
    a = parser.parse_args()
    make(a.name, a.raw, a.sequences, a.runs, a.tables, a.figures)
