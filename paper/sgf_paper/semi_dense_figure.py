"""Figure 3: points reconstructed by patch search, drawn beside the true ones, and their errors."""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from sgf_paper import config, style, text
from sgf_paper.study_config import SemiDense, SemiDenseRow

WIDTH = 10.0  # of the figure, inches
PIXELS = 400  # across a panel
# Dark where there is no error, so that points stand out against the white ground.
ERRORS = matplotlib.colors.LinearSegmentedColormap.from_list(
    "errors", ["#4ca6ff", "#1f5fd0", "#303030", "#d0301f", "#ff8c4c"]
)
ERROR_LIMIT = 0.2  # depth error over true depth at which the colours end
INSIDE = 0.99  # share of the true points, along each axis, that the panels hold besides a margin
MARGIN = 0.08  # of their extent
PLY_TYPES = {"float": "<f4", "int": "<i4", "uchar": "u1"}


class PlyError(Exception):
    """A file of points that is not what it must be; the text names the file."""


def read_ply(path: Path) -> np.ndarray:
    """Vertices of a binary little-endian PLY file without faces as a structured array."""
    data = path.read_bytes()
    header, mark, body = data.partition(b"end_header\n")
    lines = header.decode("ascii", "replace")
    count = re.search(r"^element vertex (\d+)$", lines, re.MULTILINE)
    if not (mark and count and lines.startswith("ply\nformat binary_little_endian 1.0\n")):
        raise PlyError(f"{path}: not a binary little-endian PLY file of vertices")
    of_vertices = lines[count.end() :].partition("\nelement ")[0]
    properties = re.findall(r"^property (\w+) (\w+)$", of_vertices, re.MULTILINE)
    vertex = np.dtype([(name, PLY_TYPES[kind]) for kind, name in properties])
    if len(body) != int(count.group(1)) * vertex.itemsize:
        raise PlyError(f"{path}: {len(body)} bytes do not hold {count.group(1)} points")
    return np.frombuffer(body, vertex)


def _turn(yaw_deg: float, pitch_deg: float) -> np.ndarray:
    """Rotation from the camera's frame to that of a viewer left of it and above."""
    yaw, pitch = np.radians([yaw_deg, pitch_deg])
    about_y = [[np.cos(yaw), 0, -np.sin(yaw)], [0, 1, 0], [np.sin(yaw), 0, np.cos(yaw)]]
    about_x = [[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]]
    return np.array(about_x) @ np.array(about_y)


# Rows: right, down and away in the viewer's frame. The camera's is x right, y down, z forward.
VIEWS = {"top": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), "side": _turn(40, 25)}


@dataclass(frozen=True)
class Frame:
    """What part of a view's plane a panel shows, m."""

    low: np.ndarray
    high: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the panel in pixels."""
        width, height = self.high - self.low
        return max(1, round(PIXELS * height / width)), PIXELS


def _seen(points: np.ndarray, view: str) -> np.ndarray:
    """Coordinates right, down, away."""
    return np.stack([points["x"], points["y"], points["z"]], axis=1) @ VIEWS[view].T


def frame_around(truth: np.ndarray, view: str) -> Frame:
    """Holds the true points but for the outermost ones, and a margin."""
    plane = _seen(truth, view)[:, :2]
    low, high = np.quantile(plane, [(1 - INSIDE) / 2, (1 + INSIDE) / 2], axis=0)
    margin = MARGIN * (high - low).max()
    return Frame(low - margin, high + margin)


def _colours(points: np.ndarray, colour: str) -> np.ndarray:
    """One RGB colour per point: the image's grey, or the depth error over the true depth."""
    if colour == "grey":
        return np.repeat(0.85 * points["red"][:, None] / 255, 3, axis=1)
    relative = points["depth_error"] / (points["z"] - points["depth_error"])
    return ERRORS(0.5 + 0.5 * relative / ERROR_LIMIT)[:, :3]


def render(points: np.ndarray, row: SemiDenseRow, frame: Frame) -> np.ndarray:
    """Points as pixels of an orthographic view, nearer ones over those behind; white: none."""
    rows, columns = frame.shape
    seen = _seen(points, row.view)
    order = np.argsort(-seen[:, 2], kind="stable")
    pixels = (seen[order, :2] - frame.low) / (frame.high - frame.low) * [columns, rows]
    x, y = np.floor(pixels).astype(int).T
    inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    image = np.ones((rows, columns, 3))
    image[y[inside], x[inside]] = _colours(points[order[inside]], row.colour)
    return image


def caption(scores: pd.Series, bad_pct: float) -> str:
    """The numbers below a panel."""
    return (
        f"{scores.kept} kept ({scores.kept_pct:.0f} %)\n"
        f"median {100 * scores.median_m:.1f} cm, 90th {100 * scores.p90_m:.1f} cm\n"
        f"off by > {bad_pct:g} %: {scores.bad_pct:.1f} %"
    )


def _draw_row(
    axes: np.ndarray, row: SemiDenseRow, clouds: list[np.ndarray], frame: Frame
) -> None:
    for axis, points in zip(axes, clouds):
        axis.imshow(render(points, row, frame), interpolation="nearest")
        axis.set_xticks([])
        axis.set_yticks([])
    axes[0].set_ylabel(row.title)


def _write_captions(axes: np.ndarray, scores: pd.DataFrame, figure: SemiDense, case: str) -> None:
    axes[0].set_xlabel(f"{scores['candidates'].iloc[0]} points")
    for axis, column in zip(axes[1:], figure.drawn):
        axis.set_xlabel(caption(scores.loc[case, column], figure.bad_pct))


def draw(figure: SemiDense, truth: np.ndarray, clouds: dict, scores: pd.DataFrame) -> plt.Figure:
    """The true points and those of each column, one row of panels per row of the experiment.

    @param clouds points by (case, column).
    @param scores indexed by case and column.
    """
    frames = [frame_around(truth, row.view) for row in figure.rows]
    heights = [frame.shape[0] / PIXELS for frame in frames]
    columns = 1 + len(figure.drawn)
    size = (WIDTH, WIDTH / columns * sum(heights) + 0.4 * len(heights) + 1.0)
    drawing, axes = plt.subplots(
        len(figure.rows),
        columns,
        figsize=size,
        squeeze=False,
        layout="constrained",
        gridspec_kw={"height_ratios": heights},
    )
    for axis, title in zip(axes[0], ["ground truth", *figure.drawn]):
        axis.set_title(title)
    cases = [row.case for row in figure.rows]
    for index, (row, frame) in enumerate(zip(figure.rows, frames)):
        panels = [truth, *(clouds[row.case, column] for column in figure.drawn)]
        _draw_row(axes[index], row, panels, frame)
        if row.case not in cases[index + 1 :]:
            _write_captions(axes[index], scores, figure, row.case)
    if any(row.colour == "error" for row in figure.rows):
        _add_colour_bar(drawing, axes)
    return drawing


def _add_colour_bar(drawing: plt.Figure, axes: np.ndarray) -> None:
    scale = matplotlib.cm.ScalarMappable(
        matplotlib.colors.Normalize(-100 * ERROR_LIMIT, 100 * ERROR_LIMIT), ERRORS
    )
    drawing.colorbar(
        scale,
        ax=axes,
        location="bottom",
        label="depth error, % of the true depth (red: too far)",
        aspect=60,
        shrink=0.5,
        pad=0.01,
    )


def make_figure(name: str, raw: Path, tables: Path, figures: Path) -> None:
    """Draws what `sgf_study semi-dense` wrote below `raw` and tabulates its scores."""
    figure = config.load_experiment(name)
    scores = pd.read_csv(raw / "scores.csv")
    text.write_csv(scores, tables / f"{name}.csv")
    document = text.render("semi_dense.md.j2", figure=figure, scores=scores)
    (tables / f"{name}.md").write_text(document)
    clouds = {
        (case, column): read_ply(raw / case / f"{column}.ply")
        for case in {row.case for row in figure.rows}
        for column in figure.drawn
    }
    indexed = scores.set_index(["case", "column"])
    drawing = draw(figure, read_ply(raw / "truth.ply"), clouds, indexed)
    drawing.suptitle(f"{figure.title}: {scores['pair'].iloc[0]}")
    style.save(drawing, figures, name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="figure of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="what sgf_study semi-dense wrote")
    parser.add_argument("--tables", type=Path, required=True, help="folder for CSV and Markdown")
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figure")
    a = parser.parse_args()
    make_figure(a.name, a.raw, a.tables, a.figures)


if __name__ == "__main__":
    main()
