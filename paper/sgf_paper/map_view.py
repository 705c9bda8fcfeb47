"""Maps and trajectories drawn from above and from the side, beside the ground truth."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np

from sgf_paper import config, style
from sgf_paper.semi_dense_figure import read_ply
from sgf_paper.sequences import read_motion
from sgf_paper.style import plt

MARGINS = (1.6, 1.0)  # of a row around its panels: width and height, inches
LEGEND_HEIGHT = 0.25  # inches
INSIDE_PCT = 94  # of the points, along each axis, that the panels hold besides a margin
MARGIN_M = 0.4
AXES = {"from above": (0, 1), "from the side": (0, 2)}  # right and up in the panels

Folders = dict[str, tuple[Path, Path]]  # what the programs wrote, and the sequence, by its name


@dataclass(frozen=True)
class Map:
    """What came of one sequence, in the world of the ground truth, m."""

    points: np.ndarray  # N×3
    path: np.ndarray  # M×3, the body
    truth: np.ndarray  # K×3, the body

    @property
    def bulk(self) -> np.ndarray:
        """Corners, 2×3, of the box that the paths and the bulk of the points fill."""
        cut = (100 - INSIDE_PCT) / 2
        inner = np.percentile(self.points, [cut, 100 - cut], axis=0) if len(self.points) else self.truth
        filled = np.concatenate([inner, self.path, self.truth])
        return np.stack([filled.min(axis=0), filled.max(axis=0)])


@dataclass(frozen=True)
class Panel:
    title: str
    map: Map
    view: str  # of AXES


@dataclass(frozen=True)
class Row:
    """Panels side by side. All show the same part of the world, in the same colours."""

    title: str
    panels: list[Panel]

    def limits(self, axis: int) -> tuple[float, float]:
        """What the panels show along an axis: the bulk of all points, and all paths."""
        boxes = np.stack([panel.map.bulk[:, axis] for panel in self.panels])
        return boxes[:, 0].min() - MARGIN_M, boxes[:, 1].max() + MARGIN_M

    @property
    def aspects(self) -> list[float]:
        """Width over height of each panel."""
        lengths = [np.diff(self.limits(axis)).item() for axis in range(3)]
        return [lengths[right] / lengths[up] for right, up in (AXES[panel.view] for panel in self.panels)]


def read_positions(path: Path) -> np.ndarray:
    """Positions of a PLY file's points, N×3."""
    vertices = read_ply(path)
    return np.stack([vertices[axis].astype(float) for axis in "xyz"], axis=1)


def read_truth(sequence: Path, times_s: np.ndarray) -> np.ndarray:
    """Places of the body at given times, N×3, m, from either file that EuRoC's layout may have."""
    mav0 = sequence / "mav0"
    folder = mav0 / "state_groundtruth_estimate0"
    if (folder / "data.csv").exists():
        poses = read_motion(mav0).to_numpy()
    else:
        poses = np.loadtxt(folder / "groundtruth_tum.txt")
    return np.stack([np.interp(times_s, poses[:, 0], poses[:, axis]) for axis in (1, 2, 3)], axis=1)


def _draw_panel(axis: plt.Axes, row: Row, panel: Panel) -> matplotlib.collections.PathCollection:
    """Points coloured by height, and the two paths. @returns the points."""
    right, up = AXES[panel.view]
    points, path, truth = panel.map.points, panel.map.path, panel.map.truth
    dots = {"s": 0.8, "cmap": "viridis", "linewidths": 0, "rasterized": True}
    bounds = dict(zip(("vmin", "vmax"), row.limits(2)))
    drawn = axis.scatter(points[:, right], points[:, up], c=points[:, 2], **dots, **bounds)
    axis.plot(truth[:, right], truth[:, up], color="black", linewidth=2.4, label="ground truth")
    axis.plot(path[:, right], path[:, up], color=style.COLOURS["sgf"], linewidth=1, label="estimate")
    axis.plot(path[-1:, right], path[-1:, up], "o", color=style.COLOURS["sgf"], markersize=4, label="its end")
    axis.set(xlim=row.limits(right), ylim=row.limits(up), aspect="equal", title=panel.title)
    axis.set(xlabel=f"{'xyz'[right]}, m", ylabel=f"{'xyz'[up]}, m")
    return drawn


def draw(rows: list[Row], width: float) -> plt.Figure:
    """The rows below each other, and below them the legend. @param width of the figure, inches."""
    heights = [(width - MARGINS[0]) / sum(row.aspects) + MARGINS[1] for row in rows] + [LEGEND_HEIGHT]
    drawing = plt.figure(figsize=(width, sum(heights)), layout="constrained")
    *parts, legend = drawing.subfigures(len(heights), 1, height_ratios=heights)
    for part, row in zip(parts, rows):
        axes = part.subplots(1, len(row.panels), width_ratios=row.aspects)
        for axis, panel in zip(axes, row.panels):
            points = _draw_panel(axis, row, panel)
        part.colorbar(points, ax=axes[-1], label="height z, m", fraction=0.04, pad=0.02)
        part.suptitle(row.title)
    legend.legend(*parts[0].axes[0].get_legend_handles_labels(), loc="center", ncols=3, frameon=False)
    return drawing


def run(description: str | None, make_figure: Callable[[str, Folders, Path, Path], None]) -> None:
    """The command line of modules that show maps of sequences.

    @param make_figure takes the experiment's name, and the folders for its tables and figures last.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="folder of what the programs wrote, by name")
    parser.add_argument("--suite", type=Path, required=True, help="folder of the rendered sequences")
    parser.add_argument("--data", default="", help="folder with downloaded data sets")
    parser.add_argument("--tables", type=Path, required=True, help="folder for the table")
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figure")
    a = parser.parse_args()
    experiment = config.load_experiment(a.name)
    folders = {
        name: (a.raw / name, experiment.sequences[name].path(a.suite, a.data))
        for name in experiment.present(a.data)
    }
    make_figure(a.name, folders, a.tables, a.figures)
