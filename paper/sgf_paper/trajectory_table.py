"""The paper's Table III: how often odometry succeeds, and how exact it is then."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd

from sgf_paper import config, paired, repeated_runs, style, text
from sgf_paper.deviations import load_deviations
from sgf_paper.repeated_runs import ALL, KEYS
from sgf_paper.style import plt
from sgf_paper.tracking_config import TrajectoryTable, load_published_trajectories

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
COMPARED_ERRORS = [
    "sequence", "condition", "column", "baseline", "pairs", "both_failed", "ratio", "ratio_low", "ratio_high",
    "verdict",
]  # fmt: skip
LEGEND_COLUMNS = 6
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
    published = load_published_trajectories(study)
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
        ate, mean = (paired.estimate_median(own[name], own["first_frame"]) for name in ("ate_mm", "ate_mean_mm"))
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
                    "runs": own["run"].nunique(),
                    **asdict(difference),
                })  # fmt: skip
    return pd.DataFrame(lines)


def compare_errors(study: TrajectoryTable, runs: pd.DataFrame) -> pd.DataFrame:
    """ATE RMSE of the compared columns over the baselines', pair by pair: all sequences, then each."""
    together = runs.assign(sequence=ALL, cluster=runs["sequence"])
    every = pd.concat([together, runs.assign(cluster=runs["sequence"])])
    lines = []
    for (condition, sequence), own in every.groupby(["condition", "sequence"], sort=False):
        wide = own.pivot(index=["cluster", "first_frame", "run"], columns="column", values="ate_mm")
        clusters = [(cluster, first_frame) for cluster, first_frame, _ in wide.index]
        for column, baseline in study.comparisons:
            ratio = paired.estimate_ratio(wide[column], wide[baseline], clusters)
            judged = replace(ratio, runs=min(ratio.runs, own["run"].nunique()))
            values = (
                sequence, condition, column, baseline, len(wide),
                np.isinf(wide[[column, baseline]]).all(axis=1).sum(), ratio.median, ratio.low, ratio.high,
                paired.verdict(judged, study.verdict_runs, study.margin_pct),
            )  # fmt: skip
            lines.append(dict(zip(COMPARED_ERRORS, values)))
    return pd.DataFrame(lines, columns=COMPARED_ERRORS)


def draw_curves(
    axis: plt.Axes, runs: pd.DataFrame, limits: tuple[float, float], by: str, styles: dict[str, dict]
) -> None:
    """A curve for each value of column `by`: the share of its runs with an error below x."""
    for label, own in runs.groupby(by, sort=False):
        reached = np.sort(own.loc[~own["failed"], "ate_mm"]).clip(limits[0])
        shares = 100 * np.arange(reached.size + 1) / len(own)
        axis.step(
            [limits[0], *reached, limits[1]],
            [*shares, shares[-1]],
            where="post",
            label=label,
            **styles[label],
        )
    axis.set_xscale("log")
    axis.set(xlim=limits, ylim=(0, 103), xlabel="ATE RMSE, mm")
    style.label_decades(axis.xaxis)
    axis.grid(which="major", alpha=0.3, linewidth=0.5)


def error_limits(runs: pd.DataFrame) -> tuple[float, float]:
    """Where the axis of errors begins and ends: three decades at most."""
    reached = runs.loc[~runs["failed"], "ate_mm"]
    if reached.empty:
        return 1, 10
    last = 1.25 * reached.max()
    return max(0.8 * reached.min(), last / 1000), last


def draw(study: TrajectoryTable, runs: pd.DataFrame) -> plt.Figure:
    """How many runs stay below an error, a panel per condition, all its sequences together."""
    limits = error_limits(runs)
    extra = [column for column in study.columns if column not in style.COLOURS]
    styles = {column: style.line_style(column, extra) for column in study.columns}
    conditions = list(runs["condition"].unique())
    below, width = 0.1 + 0.17 * math.ceil(len(styles) / LEGEND_COLUMNS), 1 + 3.6 * len(conditions)  # inches
    height = 3.1 + below
    drawing, axes = plt.subplots(1, len(conditions), figsize=(width, height), squeeze=False)
    for axis, condition in zip(axes[0], conditions):
        own = runs[runs["condition"] == condition]
        draw_curves(axis, own, limits, "column", styles)
        counts = own["sequence"].nunique(), len(own.drop_duplicates(["sequence", "run"]))
        axis.set_title("{} (sequences: {}, runs of each column: {})".format(condition, *counts))
    axes[0, 0].set_ylabel("runs with a smaller error, %")
    lines = axes[0, 0].get_legend_handles_labels()
    drawing.legend(*lines, loc="lower center", ncol=LEGEND_COLUMNS, frameon=False)
    drawing.suptitle(f"{study.title}\nruns that fail reach no error")
    drawing.tight_layout(rect=(0, below / height, 1, 1))
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


def make_trajectory_table(
    name: str, raw: Path, sequences: list[str], runs: int, tables: Path, figures: Path
) -> None:
    """Makes <name>.csv, _compared.csv, _ate_compared.csv, _runs.csv, .md, .tex and the figure."""
    study = config.load_experiment(name)
    lines = read_runs(study, raw, sequences, runs)
    table, compared, errors = make_table(study, lines), compare(study, lines), compare_errors(study, lines)
    frames = {"": table, "_compared": compared, "_ate_compared": errors, "_runs": lines}
    repeated_runs.write_csvs(name, tables, frames)
    context = {
        **repeated_runs.document_context(study, sequences, runs),
        "blocks": make_blocks(table),
        "compared": compared_rows(compared),
        "compared_errors": repeated_runs.ratio_rows(errors),
    }
    for extension in ("md", "tex"):
        document = text.render(f"trajectory_table.{extension}.j2", notes=load_deviations(), **context)
        (tables / f"{name}.{extension}").write_text(document)
    style.save(draw(study, lines), figures, name)


if __name__ == "__main__":
    repeated_runs.run_report(__doc__, make_trajectory_table)
