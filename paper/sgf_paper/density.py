"""Error against the share of pixels kept: curves, and the columns compared at equal shares.

Mean and bad-pixel figures fall as a matcher leaves out more pixels, so a fair comparison looks at the
whole curve. Here the window is a table's fixed one and uniqueness is swept.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from sgf_paper import config, scores, style, text
from sgf_paper.config import Density, Sweep

KEYS = ["dataset", "region", "matcher", "cost", "window"]
CURVE_COLUMNS = [*KEYS, "uniqueness", "kept_pct", *scores.ERRORS, "scenes"]
EQUAL_COLUMNS = [*KEYS, "kept_pct", *scores.ERRORS, "scenes"]


@dataclass(frozen=True)
class Panel:
    """One data set and region at one window."""

    dataset: str
    region: str
    window: int  # px
    scenes: int

    @property
    def title(self) -> str:
        return f"{self.dataset}, {self.region}, {self.window}x{self.window} window, {self.scenes} scenes"


Curves = dict[str, pd.DataFrame]


def _table_panels(table: config.Table, sweep: Sweep, dataset: str, raw: Path) -> dict[Panel, Curves]:
    every = scores.read_scores(raw, sweep, dataset)
    window = table.fixed["window"]
    panels = {}
    for region in scores.regions_of(every):
        in_region = every[every["region"] == region]
        panel = Panel(dataset, region, window, in_region["scene"].nunique())
        panels[panel] = {
            column: scores.curve(in_region[in_region["column"] == column], window)
            for column in sweep.columns
        }
    return panels


def make_curves(
    density: Density, tables: dict[str, config.Table], sweep: Sweep, raw: Path, datasets: dict
) -> dict[Panel, Curves]:
    """Density curves of every column, by data set, region and window."""
    panels = {}
    for name in density.tables:
        for dataset in tables[name].present(datasets):
            panels.update(_table_panels(tables[name], sweep, dataset, raw))
    return panels


def _keys(panel: Panel, sweep: Sweep, column: str) -> dict:
    return dict(zip(KEYS, [panel.dataset, panel.region, sweep.matcher, column, panel.window]))


def curve_table(panels: dict[Panel, Curves], sweep: Sweep) -> pd.DataFrame:
    """All points of all curves."""
    rows = []
    for panel, curves in panels.items():
        for column, points in curves.items():
            for point in points.sort_values("uniqueness").to_dict("records"):
                rows.append({**_keys(panel, sweep, column), **point, "scenes": panel.scenes})
    return pd.DataFrame(rows, columns=CURVE_COLUMNS)


def equal_table(panels: dict[Panel, Curves], sweep: Sweep, shares: list[float]) -> pd.DataFrame:
    """Errors read off the curves at given shares; NaN where a curve does not get there."""
    rows = []
    for panel, curves in panels.items():
        for column, points in curves.items():
            for kept_pct in shares:
                errors = {q: scores.interpolate(points, q, kept_pct) for q in scores.ERRORS}
                row = {"kept_pct": kept_pct, **errors, "scenes": panel.scenes}
                rows.append({**_keys(panel, sweep, column), **row})
    return pd.DataFrame(rows, columns=EQUAL_COLUMNS)


def draw(panels: dict[Panel, Curves], sweep: Sweep, density: Density) -> plt.Figure:
    """One row per panel, one plot per quantity, one line per column."""
    quantities = density.quantities
    size = (3.6 * len(quantities), 0.9 + 2.5 * len(panels))
    figure, axes = plt.subplots(len(panels), len(quantities), figsize=size, squeeze=False)
    for row, (panel, curves) in zip(axes, panels.items()):
        for axis, quantity in zip(row, quantities):
            _draw_plot(axis, curves, sweep, quantity)
            axis.set_title(panel.title)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=6, frameon=False)
    figure.suptitle(density.title)
    figure.tight_layout(rect=(0, 0.6 / size[1], 1, 1 - 0.15 / size[1]))
    return figure


def _top(curves: Curves, sweep: Sweep, quantity: str) -> float:
    """Upper end of the axis: what the paper's columns reach. Extra columns may leave the plot, and
    so may shares so small that a few pixels decide."""
    paper = [points for name, points in curves.items() if not sweep.columns[name].extra]
    return 1.1 * max(points.loc[points["kept_pct"] >= 10, quantity].max() for points in paper)


def _draw_plot(axis: plt.Axes, curves: Curves, sweep: Sweep, quantity: str) -> None:
    extra = [name for name, column in sweep.columns.items() if column.extra]
    for column, points in curves.items():
        style_of = style.line_style(column, extra)
        axis.plot(points["kept_pct"], points[quantity], label=column, **style_of)
    axis.set_xlabel("pixels kept, % of those with ground truth")
    axis.set_ylabel(text.LABELS[quantity])
    axis.set_ylim(0, _top(curves, sweep, quantity))
    axis.grid(alpha=0.3, linewidth=0.5)


def _markdown_blocks(equal: pd.DataFrame, density: Density) -> list[dict]:
    """For each panel and quantity a grid of columns by shares, as text."""
    blocks = []
    for (dataset, region, window), part in equal.groupby(["dataset", "region", "window"], sort=False):
        for quantity in density.quantities:
            wide = part.pivot(index="cost", columns="kept_pct", values=quantity)
            wide = wide.loc[part["cost"].unique()].dropna(axis="columns", how="all")
            rows = {
                cost: [text.format_number(value, 2) for value in line]
                for cost, line in zip(wide.index, wide.to_numpy())
            }
            title = f"{dataset}, {region}, window {window} px: {text.LABELS[quantity]}"
            blocks.append({"title": title, "shares": list(wide.columns), "rows": rows})
    return blocks


def make_density(name: str, raw: Path, listing: Path, tables_out: Path, figures_out: Path) -> None:
    """Makes density.csv, density_equal.csv, density.md and the figure."""
    density = config.load_experiment(name)
    tables = config.load_experiments("table")
    sweep = config.load_sweep(tables[density.tables[0]].sweep)
    panels = make_curves(density, tables, sweep, raw, config.read_datasets(listing))
    equal = equal_table(panels, sweep, density.kept_pct)
    text.write_csv(curve_table(panels, sweep), tables_out / f"{name}.csv")
    text.write_csv(equal, tables_out / f"{name}_equal.csv")
    document = text.render("density.md.j2", density=density, blocks=_markdown_blocks(equal, density))
    (tables_out / f"{name}.md").write_text(document)
    style.save(draw(panels, sweep, density), figures_out, name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="folder of raw scores")
    parser.add_argument("--datasets", type=Path, required=True, help="listing of sgf_eval datasets")
    parser.add_argument("--tables", type=Path, required=True, help="folder for CSV and Markdown")
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figure")
    a = parser.parse_args()
    make_density(a.name, a.raw, a.datasets, a.tables, a.figures)


if __name__ == "__main__":
    main()
