"""Error against the share of pixels kept: curves, and the columns compared at equal shares.

Mean and bad-pixel figures fall as a matcher leaves out more pixels, so a fair comparison looks at the
whole curve. Here the window is a table's fixed one and uniqueness is swept. A dense matcher has no
such curve.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from sgf_paper import config, scores, style, text
from sgf_paper.stereo_config import Density, Table, TableBlock
from sgf_paper.stereo_datasets import read_datasets

KEYS = ["dataset", "region", "matcher", "cost", "window"]
CURVE_COLUMNS = [*KEYS, "uniqueness", "kept_pct", *scores.ERRORS, "scenes"]
EQUAL_COLUMNS = [*KEYS, "kept_pct", *scores.ERRORS, "scenes"]


@dataclass(frozen=True)
class Panel:
    """One data set, region and matcher at one window."""

    dataset: str
    region: str
    matcher: str
    window: int  # px
    scenes: int

    @property
    def title(self) -> str:
        matcher = text.matcher_title(self.matcher)
        window = f"{self.window}x{self.window} window"
        return f"{matcher}, {window}\n{self.dataset}, {self.region}, {self.scenes} scenes"


Curves = dict[str, pd.DataFrame]
Rows = list[dict[Panel, Curves]]  # of the figure: panels that stand side by side


def _panel(block: TableBlock, dataset: str, region: str, lines: pd.DataFrame) -> tuple[Panel, Curves]:
    window = block.fixed["window"]
    panel = Panel(dataset, region, block.sweep.matcher, window, lines["scene"].nunique())
    return panel, {
        column: scores.curve(lines[lines["column"] == column], window)
        for column in block.sweep.sparse_columns
    }


def _dataset_rows(table: Table, dataset: str, raw: Path) -> Rows:
    """A row for each region, in it the table's matchers."""
    rows: dict[str, dict[Panel, Curves]] = {}
    for block in table.curve_blocks:
        every = scores.read_scores(raw, block.sweep, dataset)
        for region in scores.regions_of(every):
            panel, curves = _panel(block, dataset, region, every[every["region"] == region])
            rows.setdefault(region, {})[panel] = curves
    return list(rows.values())


def make_curves(density: Density, tables: dict[str, Table], raw: Path, datasets: dict) -> Rows:
    """Density curves of every column, by data set, region, matcher and window."""
    return [
        row
        for name in density.tables
        for dataset in tables[name].present(datasets)
        for row in _dataset_rows(tables[name], dataset, raw)
    ]


def _distinct(rows: Rows) -> dict[Panel, Curves]:
    """All panels; two tables may share some."""
    return {panel: curves for row in rows for panel, curves in row.items()}


def _keys(panel: Panel, column: str) -> dict:
    return dict(zip(KEYS, [panel.dataset, panel.region, panel.matcher, column, panel.window]))


def curve_table(rows: Rows) -> pd.DataFrame:
    """All points of all curves."""
    lines = []
    for panel, curves in _distinct(rows).items():
        for column, points in curves.items():
            for point in points.sort_values("uniqueness").to_dict("records"):
                lines.append({**_keys(panel, column), **point, "scenes": panel.scenes})
    return pd.DataFrame(lines, columns=CURVE_COLUMNS)


def equal_table(rows: Rows, shares: list[float]) -> pd.DataFrame:
    """Errors read off the curves at given shares; NaN where a curve does not get there."""
    lines = []
    for panel, curves in _distinct(rows).items():
        for column, points in curves.items():
            for kept_pct in shares:
                errors = {q: scores.interpolate(points, q, kept_pct) for q in scores.ERRORS}
                line = {"kept_pct": kept_pct, **errors, "scenes": panel.scenes}
                lines.append({**_keys(panel, column), **line})
    return pd.DataFrame(lines, columns=EQUAL_COLUMNS)


def _extra_columns(tables: dict[str, Table]) -> list[str]:
    """Columns beyond the paper's of all blocks, each once."""
    blocks = [block for table in tables.values() for block in table.curve_blocks]
    names = [name for b in blocks for name in b.sweep.sparse_columns if b.sweep.columns[name].extra]
    return list(dict.fromkeys(names))


def draw(rows: Rows, extra: list[str], density: Density) -> plt.Figure:
    """Rows of panels, one plot per panel and quantity, one line per column.

    @param extra columns that are not the paper's.
    """
    quantities = density.quantities
    abreast = max(map(len, rows)) * len(quantities)
    size = (3.4 * abreast, 0.9 + 2.6 * len(rows))
    figure, axes = plt.subplots(len(rows), abreast, figsize=size, squeeze=False)
    for row, line in zip(rows, axes):
        plots = [(panel, quantity) for panel in row for quantity in quantities]
        for axis, (panel, quantity) in zip(line, plots):
            _draw_plot(axis, row[panel], extra, quantity)
            axis.set_title(panel.title)
    handles = {
        label: handle
        for axis in axes[0]
        for handle, label in zip(*axis.get_legend_handles_labels())
    }
    figure.legend(handles.values(), handles, loc="lower center", ncol=7, frameon=False)
    figure.suptitle(density.title)
    figure.tight_layout(rect=(0, 0.6 / size[1], 1, 1 - 0.15 / size[1]))
    return figure


def _top(curves: Curves, extra: list[str], quantity: str) -> float:
    """Upper end of the axis: what the paper's columns reach. Extra columns may leave the plot, and
    so may shares so small that a few pixels decide."""
    paper = [points for name, points in curves.items() if name not in extra]
    return 1.1 * max(points.loc[points["kept_pct"] >= 10, quantity].max() for points in paper)


def _draw_plot(axis: plt.Axes, curves: Curves, extra: list[str], quantity: str) -> None:
    for column, points in curves.items():
        style_of = style.line_style(column, extra)
        axis.plot(points["kept_pct"], points[quantity], label=column, **style_of)
    axis.set_xlabel("pixels kept, % of those with ground truth")
    axis.set_ylabel(text.LABELS[quantity])
    axis.set_ylim(0, _top(curves, extra, quantity))
    axis.grid(alpha=0.3, linewidth=0.5)


def _markdown_blocks(equal: pd.DataFrame, density: Density) -> list[dict]:
    """For each panel and quantity a grid of columns by shares, as text."""
    blocks = []
    keys = ["dataset", "region", "matcher", "window"]
    for (dataset, region, matcher, window), part in equal.groupby(keys, sort=False):
        for quantity in density.quantities:
            wide = part.pivot(index="cost", columns="kept_pct", values=quantity)
            wide = wide.loc[part["cost"].unique()].dropna(axis="columns", how="all")
            rows = {
                cost: [text.format_number(value, 2) for value in line]
                for cost, line in zip(wide.index, wide.to_numpy())
            }
            where = f"{dataset}, {region}, {text.matcher_title(matcher)}, window {window} px"
            title = f"{where}: {text.LABELS[quantity]}"
            blocks.append({"title": title, "shares": list(wide.columns), "rows": rows})
    return blocks


def make_density(name: str, raw: Path, listing: Path, tables_out: Path, figures_out: Path) -> None:
    """Makes density.csv, density_equal.csv, density.md and the figure."""
    density = config.load_experiment(name)
    tables = {table: config.load_experiment(table) for table in density.tables}
    rows = make_curves(density, tables, raw, read_datasets(listing))
    equal = equal_table(rows, density.kept_pct)
    text.write_csv(curve_table(rows), tables_out / f"{name}.csv")
    text.write_csv(equal, tables_out / f"{name}_equal.csv")
    document = text.render("density.md.j2", density=density, blocks=_markdown_blocks(equal, density))
    (tables_out / f"{name}.md").write_text(document)
    style.save(draw(rows, _extra_columns(tables), density), figures_out, name)


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
