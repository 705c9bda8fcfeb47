"""What the MRPT module makes of rawlogs: map points and trajectory from above and from the side."""

from __future__ import annotations

import argparse
import json
import re
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd

from sgf_paper import config, style, text
from sgf_paper.config import MrptMap
from sgf_paper.semi_dense_figure import read_ply
from sgf_paper.sequences import read_motion
from sgf_paper.style import plt

WIDTH = 9.0  # of the figure, inches
MARGINS = (1.6, 1.0)  # of a row around its panels: width and height, inches
INSIDE_PCT = 94  # of the points, along each axis, that the panels hold besides a margin
MARGIN_M = 0.4
AXES = {"from above": (0, 1), "from the side": (0, 2)}  # right and up in the panels
COUNTS = re.compile(r"frames: (\d+), with pose: (\d+), lost: \d+, restarts: \d+, key-frames: (\d+)")


class ReportError(Exception):
    """A report of the odometry that is not understood; the text names the file."""


@dataclass(frozen=True)
class Run:
    """What came of one rawlog, in the world of the ground truth, m."""

    points: np.ndarray  # N×3
    path: np.ndarray  # M×3, the body at frame time
    truth: np.ndarray  # M×3, at the same times
    numbers: dict[str, float]


def rigid_alignment(source: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation R and translation t with the least squares of target - (R source + t), both N×3."""
    centres = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - centres[1]).T @ (source - centres[0]))
    R = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return R, centres[1] - R @ centres[0]


def read_counts(report: Path) -> dict[str, int]:
    """Counts of frames, poses and key-frames that sgf-odometry-cli reports."""
    found = COUNTS.search(report.read_text())
    if not found:
        raise ReportError(f"{report}: no line with counts of frames")
    return dict(zip(("frames", "posed", "keyframes"), map(int, found.groups())))


def read_truth(sequence: Path, times_s: np.ndarray) -> np.ndarray:
    """Places of the body at given times, N×3, m, from either file that a sequence in EuRoC's layout may have."""
    mav0 = sequence / "mav0"
    folder = mav0 / "state_groundtruth_estimate0"
    if (folder / "data.csv").exists():
        poses = read_motion(mav0).to_numpy()
    else:
        poses = np.loadtxt(folder / "groundtruth_tum.txt")
    return np.stack([np.interp(times_s, poses[:, 0], poses[:, axis]) for axis in (1, 2, 3)], axis=1)


def read_run(folder: Path, sequence: Path) -> Run:
    """Reads what the programs wrote and moves it to the ground truth.

    @param folder with map.ply, map.tum, report.txt, scores.json.
    @param sequence in EuRoC's layout; the odometry's robot stands at its body's origin.
    """
    poses = np.loadtxt(folder / "map.tum", ndmin=2)
    truth = read_truth(sequence, poses[:, 0])
    vertices = read_ply(folder / "map.ply")
    points = np.stack([vertices[axis].astype(float) for axis in "xyz"], axis=1)
    R, t = rigid_alignment(poses[:, 1:4], truth)
    scores = json.loads((folder / "scores.json").read_text())
    numbers = {key: scores[key] for key in ("path_m", "ate_rmse_m")}
    counts = {**read_counts(folder / "report.txt"), "points": len(points)}
    return Run(points @ R.T + t, poses[:, 1:4] @ R.T + t, truth, {**counts, **numbers})


def limits(run: Run, axis: int) -> tuple[float, float]:
    """What a panel shows along an axis: the bulk of the points, and the path."""
    cut = (100 - INSIDE_PCT) / 2
    low, high = np.percentile(run.points[:, axis], [cut, 100 - cut])
    path = np.concatenate([run.path[:, axis], run.truth[:, axis]])
    return min(low, path.min()) - MARGIN_M, max(high, path.max()) + MARGIN_M


def aspect(run: Run, view: str) -> float:
    """Width over height of a panel."""
    right, up = (np.diff(limits(run, axis)).item() for axis in AXES[view])
    return right / up


def _draw_panel(axis: plt.Axes, run: Run, view: str) -> matplotlib.collections.PathCollection:
    """Points coloured by height, and the two paths. @returns the points."""
    right, up = AXES[view]
    dots = {"s": 0.8, "cmap": "viridis", "linewidths": 0, "rasterized": True}
    bounds = dict(zip(("vmin", "vmax"), limits(run, 2)))
    points = axis.scatter(run.points[:, right], run.points[:, up], c=run.points[:, 2], **dots, **bounds)
    axis.plot(run.truth[:, right], run.truth[:, up], color="black", linewidth=2.4, label="ground truth")
    axis.plot(run.path[:, right], run.path[:, up], color=style.COLOURS["sgf"], linewidth=1, label="estimate")
    axis.plot(*run.path[-1, [right, up]], "o", color=style.COLOURS["sgf"], markersize=4, label="its end")
    axis.set(xlim=limits(run, right), ylim=limits(run, up), aspect="equal", title=view)
    axis.set(xlabel=f"{'xyz'[right]}, m", ylabel=f"{'xyz'[up]}, m")
    return points


def _title(name: str, contents: str, numbers: dict[str, float]) -> str:
    return (
        f"{name} ({contents}): {numbers['posed']} of {numbers['frames']} frames with pose,\n"
        f"{numbers['keyframes']} key-frames, {numbers['points']} points,"
        f" ATE RMSE {1000 * numbers['ate_rmse_m']:.1f} mm"
    )


def draw(experiment: MrptMap, runs: dict[str, Run]) -> plt.Figure:
    """A row per sequence: map, estimate and ground truth, from above and from the side."""
    aspects = {name: [aspect(run, view) for view in AXES] for name, run in runs.items()}
    heights = [(WIDTH - MARGINS[0]) / sum(both) + MARGINS[1] for both in aspects.values()]
    drawing = plt.figure(figsize=(WIDTH, sum(heights)), layout="constrained")
    rows = drawing.subfigures(len(runs), 1, height_ratios=heights, squeeze=False)[:, 0]
    for row, (name, run) in zip(rows, runs.items()):
        axes = row.subplots(1, len(AXES), width_ratios=aspects[name])
        for axis, view in zip(axes, AXES):
            points = _draw_panel(axis, run, view)
        row.colorbar(points, ax=axes[-1], label="height z, m", fraction=0.04, pad=0.02)
        row.suptitle(_title(name, experiment.sequences[name].contents, run.numbers))
    rows[0].axes[0].legend(loc="best")
    return drawing


def make_figure(name: str, folders: dict[str, tuple[Path, Path]], tables: Path, figures: Path) -> None:
    """Makes the table and the figure. @param folders what was written, and the sequence, by name."""
    experiment = config.load_experiment(name)
    runs = {sequence: read_run(*paths) for sequence, paths in folders.items()}
    table = pd.DataFrame([{"sequence": sequence, **run.numbers} for sequence, run in runs.items()])
    text.write_csv(table, tables / f"{name}.csv")
    document = text.render("mrpt_map.md.j2", experiment=experiment, rows=list(table.itertuples()))
    (tables / f"{name}.md").write_text(document)
    style.save(draw(experiment, runs), figures, name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
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


if __name__ == "__main__":
    main()
