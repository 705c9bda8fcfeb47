"""What the MRPT module makes of rawlogs: map points and trajectory from above and from the side."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from sgf_paper import config, map_view, style, text
from sgf_paper.map_view import AXES, Folders, Map, Panel, Row
from sgf_paper.style import plt
from sgf_paper.tracking_config import MrptMap

WIDTH = 9.0  # of the figure, inches
COUNTS = re.compile(r"frames: (\d+), with pose: (\d+), lost: \d+, restarts: \d+, key-frames: (\d+)")


class ReportError(Exception):
    """A report of the odometry that is not understood; the text names the file."""


@dataclass(frozen=True)
class Run:
    """What came of one rawlog."""

    map: Map  # truth at the times of the path's poses
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


def read_run(folder: Path, sequence: Path) -> Run:
    """Reads what the programs wrote and moves it to the ground truth.

    @param folder with map.ply, map.tum, report.txt, scores.json.
    @param sequence in EuRoC's layout; the odometry's robot stands at its body's origin.
    """
    poses = np.loadtxt(folder / "map.tum", ndmin=2)
    truth = map_view.read_truth(sequence, poses[:, 0])
    points = map_view.read_positions(folder / "map.ply")
    R, t = rigid_alignment(poses[:, 1:4], truth)
    scores = json.loads((folder / "scores.json").read_text())
    numbers = {key: scores[key] for key in ("path_m", "ate_rmse_m")}
    counts = {**read_counts(folder / "report.txt"), "points": len(points)}
    return Run(Map(points @ R.T + t, poses[:, 1:4] @ R.T + t, truth), {**counts, **numbers})


def _title(name: str, contents: str, numbers: dict[str, float]) -> str:
    return (
        f"{name} ({contents}): {numbers['posed']} of {numbers['frames']} frames with pose,\n"
        f"{numbers['keyframes']} key-frames, {numbers['points']} points,"
        f" ATE RMSE {1000 * numbers['ate_rmse_m']:.1f} mm"
    )


def draw(experiment: MrptMap, runs: dict[str, Run]) -> plt.Figure:
    """A row per sequence: map, estimate and ground truth, from above and from the side."""
    rows = [
        Row(
            _title(name, experiment.sequences[name].contents, run.numbers),
            [Panel(view, run.map, view) for view in AXES],
        )
        for name, run in runs.items()
    ]
    return map_view.draw(rows, WIDTH)


def make_figure(name: str, folders: Folders, tables: Path, figures: Path) -> None:
    """Makes the table and the figure."""
    experiment = config.load_experiment(name)
    runs = {sequence: read_run(*paths) for sequence, paths in folders.items()}
    table = pd.DataFrame([{"sequence": sequence, **run.numbers} for sequence, run in runs.items()])
    text.write_csv(table, tables / f"{name}.csv")
    document = text.render("mrpt_map.md.j2", experiment=experiment, rows=list(table.itertuples()))
    (tables / f"{name}.md").write_text(document)
    style.save(draw(experiment, runs), figures, name)


if __name__ == "__main__":
    map_view.run(__doc__, make_figure)
