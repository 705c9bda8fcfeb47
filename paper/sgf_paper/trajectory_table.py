"""The paper's Table III: how often odometry succeeds, and how exact it is then."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd

from sgf_paper import config, paired, repeated_runs, style, text
from sgf_paper.config import TrajectoryTable
from sgf_paper.repeated_runs import KEYS
from sgf_paper.style import plt

RULES = ["scale", "ate"]  # of success; errors are those of runs that succeed by the first, the paper's
ERRORS = ["ate_mm", "ate_mean_mm", "rpe_one_second_mm", "rpe_one_second_deg", "orientation_deg"]
RUN = [
    *KEYS, "run", "first_frame", "frames", "posed", "lost", "clipped_pct", "path_m", "own_ate_m",
    "own_ate_median_m", "own_ate_max_m", "scale_error_median_m", "scale_error_max_m",
    *(f"success_{rule}" for rule in RULES), "failed", "compared", *ERRORS,
]  # fmt: skip
LINE = [
    *KEYS, "runs", "lost", *(f"success_{rule}" for rule in RULES), "failed", "posed_pct", "clipped_pct",
    "ate_mm", "ate_low_mm", "ate_high_mm", "ate_q75_mm", "ate_q90_mm",
    "ate_mean_mm", "ate_mean_low_mm", "ate_mean_high_mm", "ate_mean_of_successes_mm", "published_mm",
    "rpe_one_second_mm", "rpe_one_second_deg", "orientation_deg",
]  # fmt: skip
NAN = float("nan")


def read_runs(study: TrajectoryTable, raw: Path, sequences: list[str], runs: int) -> pd.DataFrame:
    """A line per run; errors in mm and degrees, infinite where a run fails by the paper's rule.

    Both rules judge a run by all of its own poses, and take our limit in per cent of the path.
    """
    table = repeated_runs.read_scores(study, raw, sequences, runs)
    near = table["own_ate_m"] <= study.fail_above_pct / 100 * table["path_m"]  # not of lost runs
    for rule in RULES:
        table[f"success_{rule}"] = near & table[f"success_by_{rule}"].eq(True)
    table["failed"] = ~table[f"success_{RULES[0]}"]
    table.loc[table["failed"], ERRORS] = np.inf
    return table[RUN]


def _published_mm(study: TrajectoryTable) -> dict[tuple[str, str], float]:
    """The paper's mean ATE by sequence and column."""
    published = config.load_published_trajectories(study)
    return {
        (name, column): 1000 * values[sequence.published]
        for name, sequence in study.sequences.items()
        for column, values in published.items()
        if sequence.published in values
    }


def make_table(study: TrajectoryTable, runs: pd.DataFrame) -> pd.DataFrame:
    """A line per sequence, condition and column: medians and quantiles over runs, means of shares."""
    published = _published_mm(study)
    lines = []
    for key, own in runs.groupby(KEYS, sort=False):
        ate, mean = (paired.estimate_median(own[name]) for name in ("ate_mm", "ate_mean_mm"))
        q75, q90 = paired.quantiles(own["ate_mm"], [0.75, 0.9])
        sequence, condition, column = key
        compared = condition == study.undisturbed
        lines.append({
            **dict(zip(KEYS, key)),
            "runs": len(own),
            **own[["lost", "failed", *(f"success_{rule}" for rule in RULES)]].sum(),
            "posed_pct": repeated_runs.posed_pct(own).mean(),
            "clipped_pct": own["clipped_pct"].mean(),
            **own[ERRORS].median(),
            "ate_low_mm": ate.low,
            "ate_high_mm": ate.high,
            "ate_q75_mm": q75,
            "ate_q90_mm": q90,
            "ate_mean_low_mm": mean.low,
            "ate_mean_high_mm": mean.high,
            "ate_mean_of_successes_mm": own.loc[~own["failed"], "ate_mean_mm"].mean(),
            "published_mm": published.get((sequence, column), NAN) if compared else NAN,
        })  # fmt: skip
    return pd.DataFrame(lines, columns=LINE)


def compare(study: TrajectoryTable, runs: pd.DataFrame) -> pd.DataFrame:
    """Successes of the compared columns against the baselines, over all sequences of a condition."""
    lines = []
    for condition, own in runs.groupby("condition", sort=False):
        for rule in RULES:
            wide = own.pivot(
                index=["sequence", "first_frame", "run"], columns="column", values=f"success_{rule}"
            )
            clusters = [(sequence, first_frame) for sequence, first_frame, _ in wide.index]
            for column, baseline in study.comparisons:
                difference = paired.compare_success(wide[column], wide[baseline], clusters)
                lines.append({
                    "condition": condition,
                    "column": column,
                    "baseline": baseline,
                    "rule": rule,
                    "sequences": own["sequence"].nunique(),
                    **asdict(difference),
                })  # fmt: skip
    return pd.DataFrame(lines)


def _draw_panel(
    axis: plt.Axes, study: TrajectoryTable, runs: pd.DataFrame, limits: tuple[float, float]
) -> None:
    """A curve per column: the share of its runs with an error below x."""
    extra = [column for column in study.columns if column not in style.COLOURS]
    for column, own in runs.groupby("column", sort=False):
        reached = np.sort(own.loc[~own["failed"], "ate_mm"])
        shares = 100 * np.arange(reached.size + 1) / len(own)
        axis.step(
            [limits[0], *reached, limits[1]], [*shares, shares[-1]], where="post", label=column,
            **style.line_style(column, extra),
        )  # fmt: skip
    axis.set_xscale("log")
    axis.set(xlim=limits, ylim=(0, 103), xlabel="ATE RMSE, mm")
    style.label_decades(axis.xaxis)
    axis.grid(which="major", alpha=0.3, linewidth=0.5)


def draw(study: TrajectoryTable, runs: pd.DataFrame) -> plt.Figure:
    """How many runs stay below an error, a panel per condition, all its sequences together."""
    reached = runs.loc[~runs["failed"], "ate_mm"]
    limits = (1, 10) if reached.empty else (0.8 * reached.min(), 1.25 * reached.max())
    conditions = list(runs["condition"].unique())
    drawing, axes = plt.subplots(1, len(conditions), figsize=(1 + 3.6 * len(conditions), 3.4), squeeze=False)
    for axis, condition in zip(axes[0], conditions):
        own = runs[runs["condition"] == condition]
        _draw_panel(axis, study, own, limits)
        counts = own["sequence"].nunique(), len(own.drop_duplicates(["sequence", "run"]))
        axis.set_title("{} (sequences: {}, runs of each column: {})".format(condition, *counts))
    axes[0, 0].set_ylabel("runs with a smaller error, %")
    drawing.legend(*axes[0, 0].get_legend_handles_labels(), loc="lower center", ncol=6, frameon=False)
    drawing.suptitle(f"{study.title}\nruns that fail reach no error")
    drawing.tight_layout(rect=(0, 0.07, 1, 1))
    return drawing


def _row(line: object) -> dict[str, str]:
    errors = ["ate_q75_mm", "ate_q90_mm", "rpe_one_second_mm"]
    angles = ["rpe_one_second_deg", "orientation_deg"]
    return {
        "sequence": line.sequence,
        "column": line.column,
        "scale": f"{line.success_scale}/{line.runs}",
        "ate_rule": f"{line.success_ate}/{line.runs}",
        **{name: text.format_error(getattr(line, name), 1) for name in ["posed_pct", *errors]},
        "clipped_pct": text.format_error(line.clipped_pct, 2),
        "ate": text.format_estimate(line.ate_mm, line.ate_low_mm, line.ate_high_mm, 1),
        "ate_mean": text.format_estimate(line.ate_mean_mm, line.ate_mean_low_mm, line.ate_mean_high_mm, 1),
        **{name: text.format_error(getattr(line, name), 2) for name in angles},
    }


def make_blocks(table: pd.DataFrame) -> dict[str, list[dict]]:
    """The table's lines as text by condition."""
    by_condition = table.groupby("condition", sort=False)
    return {condition: [_row(line) for line in lines.itertuples()] for condition, lines in by_condition}


def compared_rows(compared: pd.DataFrame) -> list[dict]:
    """The comparisons as text."""
    return [
        {
            **line._asdict(),
            "difference": f"{line.difference_pct:+.1f} [{line.low_pct:+.1f}, {line.high_pct:+.1f}]",
            "p": f"{line.p:.2g}",
        }
        for line in compared.itertuples()
    ]


def _cell(measured: float, published: float) -> str:
    """ATE in m as in the paper, which is in brackets where it has one."""
    shown = text.format_number(measured, 3) or "–"
    return shown if published != published else f"{shown} ({published:.3f})"


def paper_grid(study: TrajectoryTable, table: pd.DataFrame) -> dict[str, list]:
    """The paper's Table III: its sequences and their average, and of each column the ATE in m as text.

    Measured is the mean over the frames and then over the runs that succeed; a sequence outside the
    paper's table has no part in the average.
    """
    published = config.load_published_trajectories(study)
    names = {sequence.published: name for name, sequence in study.sequences.items() if sequence.published}
    averaged = [label for label in names if any(label in values for values in published.values())]
    own = table[table["condition"] == study.undisturbed].set_index(["column", "sequence"])
    errors = own["ate_mean_of_successes_mm"]
    rows = []
    for column, values in published.items():
        measured = {label: errors.get((column, name), NAN) / 1000 for label, name in names.items()}
        measured["avg"] = np.mean([measured[label] for label in averaged])  # none without all of them
        cells = [_cell(error, values.get(label, NAN)) for label, error in measured.items()]
        rows.append({"column": column, "published": study.columns[column].published, "cells": cells})
    return {"labels": [*names, "avg"], "rows": rows}


def make_trajectory_table(
    name: str, raw: Path, sequences: list[str], runs: int, tables: Path, figures: Path
) -> None:
    """Makes <name>.csv, _compared.csv, _runs.csv, .md, .tex and the figure."""
    study = config.load_experiment(name)
    lines = read_runs(study, raw, sequences, runs)
    table, compared = make_table(study, lines), compare(study, lines)
    repeated_runs.write_csvs(name, tables, {"": table, "_compared": compared, "_runs": lines})
    context = {
        **repeated_runs.document_context(study, sequences, runs),
        "blocks": make_blocks(table),
        "compared": compared_rows(compared),
        "grid": paper_grid(study, table),
    }
    for extension in ("md", "tex"):
        document = text.render(f"trajectory_table.{extension}.j2", **context)
        (tables / f"{name}.{extension}").write_text(document)
    style.save(draw(study, lines), figures, name)


if __name__ == "__main__":
    repeated_runs.run_report(__doc__, make_trajectory_table)
