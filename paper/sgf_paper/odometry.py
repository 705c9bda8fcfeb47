"""Odometry with and without changes of light: which residuals get lost, how exact the others are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from sgf_paper import config, paired, repeated_runs, style, text
from sgf_paper.paired import Estimate
from sgf_paper.repeated_runs import KEYS
from sgf_paper.style import plt
from sgf_paper.tracking_config import Odometry

LINE = [
    *KEYS, "runs", "lost", "posed_pct", "clipped_pct", "ate_mm", "ate_low_mm", "ate_high_mm",
    "ratio", "ratio_low", "ratio_high", "ratio_runs",
    "rpe_half_second_mm", "rpe_one_second_mm", "rpe_one_second_deg", "orientation_deg",
]  # fmt: skip
COMPARED = [
    "sequence", "condition", "column", "baseline", "runs", "ratio", "ratio_low", "ratio_high", "verdict",
]  # fmt: skip
ERRORS = ["ate_mm", "rpe_half_second_mm", "rpe_one_second_mm", "rpe_one_second_deg", "orientation_deg"]
COLOURS = ["#0072B2", "#D55E00", *style.EXTRA_COLOURS]  # of the conditions
PANEL_COLUMNS = 2


def read_runs(study: Odometry, raw: Path, sequences: list[str], runs: int) -> pd.DataFrame:
    """A line per run; errors in mm and degrees, infinite where a run is lost."""
    table = repeated_runs.read_scores(study, raw, sequences, runs)
    table.loc[table["lost"], ERRORS] = np.inf
    columns = [*KEYS, "run", "first_frame", "frames", "posed", "lost", "clipped_pct", "compared", *ERRORS]
    return table[columns]


def errors_by_run(runs: pd.DataFrame) -> pd.DataFrame:
    """ATE in mm: a line per run, a column per sequence, condition and column."""
    return runs.pivot(index=["first_frame", "run"], columns=KEYS, values="ate_mm").sort_index(level="run")


def _estimate(values: pd.Series) -> Estimate:
    """The median of values by run, and its interval over the runs that begin differently."""
    return paired.estimate_median(values, values.index.get_level_values("first_frame"))


def _ratio(errors: pd.DataFrame, key: tuple[str, str, str], other: tuple[str, str, str]) -> Estimate:
    """Of the errors of a column over those of another, run by run."""
    return _estimate(pd.Series(paired.ratios(errors[key], errors[other]), index=errors.index))


def _ratio_fields(ratio: Estimate) -> dict[str, float]:
    return {"ratio": ratio.median, "ratio_low": ratio.low, "ratio_high": ratio.high}


def _ratio_to_undisturbed(study: Odometry, errors: pd.DataFrame, key: tuple[str, str, str]) -> Estimate:
    """Run by run; none of what is undisturbed itself."""
    sequence, condition, column = key
    if condition == study.undisturbed:
        return paired.estimate_median([])
    return _ratio(errors, key, (sequence, study.undisturbed, column))


def make_table(study: Odometry, runs: pd.DataFrame) -> pd.DataFrame:
    """A line per sequence, condition and column: medians over runs, means of shares."""
    errors = errors_by_run(runs)
    lines = []
    for key, own in runs.groupby(KEYS, sort=False):
        ate = _estimate(errors[key])
        ratio = _ratio_to_undisturbed(study, errors, key)
        lines.append({
            **dict(zip(KEYS, key)),
            "runs": len(own),
            "lost": int(own["lost"].sum()),
            "posed_pct": repeated_runs.posed_pct(own).mean(),
            "clipped_pct": own["clipped_pct"].mean(),
            **own[ERRORS].median(),
            "ate_low_mm": ate.low,
            "ate_high_mm": ate.high,
            **_ratio_fields(ratio),
            "ratio_runs": ratio.runs,
        })  # fmt: skip
    return pd.DataFrame(lines, columns=LINE)


def compare(study: Odometry, runs: pd.DataFrame) -> pd.DataFrame:
    """The compared columns against the baselines, run by run."""
    errors = errors_by_run(runs)
    lines = []
    for sequence, condition in runs[["sequence", "condition"]].drop_duplicates().itertuples(index=False):
        for column, baseline in study.comparisons:
            ratio = _ratio(errors, (sequence, condition, column), (sequence, condition, baseline))
            lines.append({
                **dict(zip(COMPARED, (sequence, condition, column, baseline, ratio.runs))),
                **_ratio_fields(ratio),
                "verdict": paired.verdict(ratio, study.verdict_runs, study.margin_pct),
            })  # fmt: skip
    return pd.DataFrame(lines, columns=COMPARED)


def _draw_column(axis: plt.Axes, lines: pd.DataFrame, place: float, width: float, colour: str) -> None:
    """Each run as a dot, their median and its interval; lost runs as a cross at the top."""
    top = axis.get_ylim()[1]
    kept = lines[~lines["lost"]]["ate_mm"]
    axis.plot([place] * len(kept), kept, ".", color=colour, markersize=3, alpha=0.6, zorder=2)
    median = paired.estimate_median(lines["ate_mm"], lines["first_frame"])
    if np.isfinite(median.median):
        ends = [place - width / 2, place + width / 2]
        axis.plot(ends, [median.median] * 2, color=colour, linewidth=2, zorder=3)
        axis.plot([place] * 2, [median.low, min(median.high, top)], color=colour, linewidth=0.8)
    if lines["lost"].any():
        axis.plot(place, top, "x", color=colour, markersize=5, clip_on=False, zorder=4)
        axis.annotate(
            f"{lines['lost'].sum()}/{len(lines)}", (place, top), (0, 5), textcoords="offset points",
            ha="center", color=colour, fontsize=6, annotation_clip=False,
        )  # fmt: skip


def _draw_panel(axis: plt.Axes, study: Odometry, lines: pd.DataFrame) -> None:
    finite = lines.loc[~lines["lost"], "ate_mm"]
    bottom, top = (1, 10) if finite.empty else (0.7 * finite.min(), 1.5 * finite.max())
    axis.set_yscale("log")
    axis.set_ylim(bottom, top)
    shift = 0.8 / len(study.conditions)
    for place, column in enumerate(study.columns):
        for index, condition in enumerate(study.conditions):
            own = lines[(lines["column"] == column) & (lines["condition"] == condition)]
            centre = place + shift * (index - (len(study.conditions) - 1) / 2)
            _draw_column(axis, own, centre, 0.7 * shift, COLOURS[index % len(COLOURS)])
    style.label_decades(axis.yaxis)
    axis.set_xticks(range(len(study.columns)), list(study.columns), rotation=25, ha="right")
    axis.tick_params(axis="x", length=0)
    axis.grid(axis="y", which="both", alpha=0.3, linewidth=0.5)
    axis.set_axisbelow(True)


def draw(study: Odometry, runs: pd.DataFrame) -> plt.Figure:
    """ATE of all runs by column, a panel per sequence, the conditions beside one another."""
    sequences = list(runs["sequence"].unique())
    columns = min(PANEL_COLUMNS, len(sequences))
    rows = -(-len(sequences) // columns)
    drawing, axes = plt.subplots(rows, columns, figsize=(9, 2.6 * rows + 0.9), squeeze=False)
    for axis, sequence in zip(axes.flat, sequences):
        _draw_panel(axis, study, runs[runs["sequence"] == sequence])
        axis.set_title(sequence, pad=14)
        axis.set_ylabel("ATE RMSE, mm")
    for axis in axes.flat[len(sequences) :]:
        axis.set_visible(False)
    handles = [plt.Line2D([], [], color=colour, linewidth=2) for colour in COLOURS]
    drawing.legend(handles, list(study.conditions), loc="lower center", ncol=4, frameon=False)
    count = runs["run"].nunique()
    drawing.suptitle(f"{study.title}\nruns of each: {count}; bars: medians; crosses: how many were lost")
    drawing.tight_layout(rect=(0, 0.25 / drawing.get_figheight(), 1, 1))
    return drawing


def _row(line: object) -> dict[str, str]:
    return {
        "column": line.column,
        "lost": f"{line.lost}/{line.runs}",
        "posed": text.format_error(line.posed_pct, 1),
        "clipped": text.format_error(line.clipped_pct, 2),
        "ate": text.format_estimate(line.ate_mm, line.ate_low_mm, line.ate_high_mm, 1),
        "ratio": text.format_estimate(line.ratio, line.ratio_low, line.ratio_high, 2),
        "rpe": text.format_error(line.rpe_one_second_mm, 1),
        "rpe_deg": text.format_error(line.rpe_one_second_deg, 2),
    }


def make_blocks(table: pd.DataFrame) -> list[dict]:
    """The table as text: a block per sequence and condition."""
    return [
        {"sequence": sequence, "condition": condition, "rows": [_row(line) for line in lines.itertuples()]}
        for (sequence, condition), lines in table.groupby(["sequence", "condition"], sort=False)
    ]


def make_odometry(
    name: str, raw: Path, sequences: list[str], runs: int, tables: Path, figures: Path
) -> None:
    """Makes <name>.csv, _compared.csv, _runs.csv, .md and the figure."""
    study = config.load_experiment(name)
    lines = read_runs(study, raw, sequences, runs)
    table, compared = make_table(study, lines), compare(study, lines)
    frames = {"": table, "_compared": compared, "_runs": lines}
    repeated_runs.write_csvs(name, tables, frames)
    document = text.render(
        "odometry.md.j2",
        **repeated_runs.document_context(study, sequences, runs),
        blocks=make_blocks(table),
        compared=repeated_runs.ratio_rows(compared),
    )
    (tables / f"{name}.md").write_text(document)
    style.save(draw(study, lines), figures, name)


if __name__ == "__main__":
    repeated_runs.run_report(__doc__, make_odometry)
