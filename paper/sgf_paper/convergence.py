"""Tracking patches under changes: which residuals converge, and how exactly."""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from sgf_paper import config, style, text
from sgf_paper.stereo_datasets import read_datasets
from sgf_paper.study_config import Convergence, ImageSet
from sgf_paper.style import plt

WIDTH = 10.0  # of the figure, inches
COLUMNS = 4  # of panels
COLOURS = {
    "photo": style.COLOURS["sad"],
    "lssd": "#000000",
    "gn": "#CC79A7",
    "sgf": style.COLOURS["sgf"],
    "ngv": "#0072B2",
    "sgv": style.COLOURS["agm"],
    "sgf3": style.COLOURS["pm"],
    "sgf3_vec": "#B8A000",
}
UNITS = {"px": "start off by, px", "deg": "start off by, degrees", "pct": "start off in scale by, %"}


def panels(table: pd.DataFrame) -> list[tuple[str, str]]:
    """Cases and units of start that have a panel each, in the table's order."""
    return list(dict.fromkeys(zip(table["case"], table["unit"])))


def _draw_panel(axis: plt.Axes, study: Convergence, lines: pd.DataFrame) -> None:
    for name in study.drawn:
        own = lines[lines["column"] == name].sort_values("start")
        colour = COLOURS.get(study.columns[name].residual, "#999999")
        axis.plot(own["start"], own["converged_pct"], label=name, color=colour, marker=".", markersize=3)
        bounds = own["converged_low_pct"], own["converged_high_pct"]
        axis.fill_between(own["start"], *bounds, color=colour, alpha=0.15, linewidth=0)
    axis.set_ylim(0, 101)
    axis.grid(alpha=0.3, linewidth=0.5)


def draw(study: Convergence, images: ImageSet, table: pd.DataFrame) -> plt.Figure:
    """Share of converged tracks against the start's offset, a panel per case and kind of offset."""
    shown = panels(table)
    rows = -(-len(shown) // COLUMNS)
    drawing, axes = plt.subplots(
        rows, COLUMNS, figsize=(WIDTH, 2.3 * rows + 0.7), sharey=True, squeeze=False
    )
    for axis, (case, unit) in zip(axes.flat, shown):
        _draw_panel(axis, study, table[(table["case"] == case) & (table["unit"] == unit)])
        axis.set_title(case)
        axis.set_xlabel(UNITS[unit])
    for axis in axes.flat[len(shown) :]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel("converged, %")
    handles, labels = axes[0][0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="lower center", ncol=len(labels), frameon=False)
    drawing.suptitle(f"{study.title}: {images.title}")
    drawing.tight_layout(rect=(0, 0.04, 1, 1))
    return drawing


def _estimate(value: float, low: float, high: float, decimals: int) -> str:
    """A value and its interval, – without a value."""
    if value != value:
        return "–"
    return f"{value:.{decimals}f} [{low:.{decimals}f}, {high:.{decimals}f}]"


def _row(line: object) -> dict[str, str]:
    share = (line.converged_pct, line.converged_low_pct, line.converged_high_pct)
    return {
        "column": line.column + ("" if line.compared else " (extra)"),
        "converged": _estimate(*share, 1),
        "own": _estimate(line.own_median_px, line.own_low_px, line.own_high_px, 3),
        "common": _estimate(line.common_median_px, line.common_low_px, line.common_high_px, 3),
    }


def make_blocks(study: Convergence, table: pd.DataFrame) -> list[dict]:
    """One block as text per case and kind of offset, at the start to show; most converged first."""
    blocks = []
    for case, unit in panels(table):
        start = study.table_start[unit]
        chosen = (table["case"] == case) & (table["unit"] == unit) & (table["start"] == start)
        lines = table[chosen].sort_values("converged_pct", ascending=False, kind="stable")
        if lines.empty:
            continue
        blocks.append({
            "case": case,
            "start": f"{start:g} {unit.replace('pct', '% of scale')}",
            "points": lines["points"].iloc[0],
            "common": lines["common"].max(),
            "rows": [_row(line) for line in lines.itertuples()],
        })  # fmt: skip
    return blocks


def make_figure(name: str, raw: Path, datasets: Path, tables: Path, figures: Path) -> None:
    """Makes the table and the figure."""
    study = config.load_experiment(name)
    images = study.images(read_datasets(datasets))
    table = pd.read_csv(raw)
    text.write_csv(table, tables / f"{name}.csv")
    document = text.render(
        "convergence.md.j2", study=study, images=images, blocks=make_blocks(study, table)
    )
    (tables / f"{name}.md").write_text(document)
    style.save(draw(study, images, table), figures, name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="CSV file that sgf_study wrote")
    parser.add_argument("--datasets", type=Path, required=True, help="data sets that were found")
    parser.add_argument("--tables", type=Path, required=True, help="folder for the tables")
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figure")
    a = parser.parse_args()
    make_figure(a.name, a.raw, a.datasets, a.tables, a.figures)


if __name__ == "__main__":
    main()
