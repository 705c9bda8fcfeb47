"""Figure 6: map and trajectory of direct odometry per way of estimating depth, and how far off the truth."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from sgf_paper import config, map_view, style, text
from sgf_paper.map_view import AXES, Folders, Map, Panel, Row
from sgf_paper.semi_dense_figure import read_ply
from sgf_paper.style import plt
from sgf_paper.tracking_config import DirectMap, MapPoints, OffSurface

WIDTH = 12.0  # of the figure, inches
SPREAD_PCT = [10, 90]  # of the offsets in a cell; a spread is what lies between
POSE = ["time_s", "x", "y", "z", "qx", "qy", "qz", "qw"]
SCORES = ["path_m", "scale", "ate_rmse_m"]


@dataclass(frozen=True)
class Run:
    """What came of one sequence and column."""

    map: Map  # of the points that are kept; truth at the times of all frames
    offsets: pd.DataFrame  # of these points to the true surface; none where that is not known
    numbers: dict[str, float]


def kept(vertices: np.ndarray, points: MapPoints) -> np.ndarray:
    """Which points of a map are shown and measured."""
    return (vertices["support"] >= points.min_support) & (vertices["variance"] <= points.max_variance)


def read_run(folder: Path, sequence: Path, points: MapPoints) -> Run:
    """Reads what the programs wrote.

    @param folder with map.ply and body.txt, in the world of the ground truth; with frames.csv, summary.json
    and scores.json; and beside it <folder>_offsets.csv where the surface is known.
    """
    keep = kept(read_ply(folder / "map.ply"), points)
    poses = pd.read_csv(folder / "body.txt", sep=" ", comment="#", names=POSE)
    times_s = pd.read_csv(folder / "frames.csv")["time_ns"].to_numpy() * 1e-9
    positions = map_view.read_positions(folder / "map.ply")[keep]
    shown = Map(positions, poses[["x", "y", "z"]].to_numpy(float), map_view.read_truth(sequence, times_s))
    offsets = folder.with_name(f"{folder.name}_offsets.csv")
    known = pd.read_csv(offsets)[keep] if offsets.exists() else pd.DataFrame()
    summary = json.loads((folder / "summary.json").read_text())
    scores = json.loads((folder / "scores.json").read_text())
    numbers = {key: summary[key] for key in ("frames", "posed", "keyframes", "segments")}
    numbers |= {"points": len(keep), "kept": int(keep.sum())}
    numbers |= {key: np.nan if scores[key] is None else scores[key] for key in SCORES}
    return Run(shown, known, numbers)


def measure_offsets(offsets_m: np.ndarray, surface: OffSurface) -> dict[str, float]:
    """How far points lie off the surface; NaN without points."""
    if not len(offsets_m):
        return dict.fromkeys(["median_m", "p90_m", "far_pct", "doubled_pct"], np.nan)
    distances = np.abs(offsets_m)
    least, largest = surface.doubled_m
    return {
        "median_m": np.median(distances),
        "p90_m": np.percentile(distances, 90),
        "far_pct": 100 * np.mean(distances > surface.far_m),
        "doubled_pct": 100 * np.mean((distances > least) & (distances <= largest)),
    }


def cell_spreads(offsets: pd.DataFrame, surface: OffSurface) -> pd.Series:
    """Spread along the surface's normal, m, by object and cell of the nearest place on its surface.

    Drift moves a wall as a whole and spreads nothing; a wall that is drawn twice has the gap as its spread.
    """
    cells = [np.floor(offsets[axis] / surface.cell_m) for axis in "xyz"]
    groups = offsets["offset_m"].groupby([offsets["object"], *cells])
    spreads = groups.agg(lambda own: np.diff(np.percentile(own, SPREAD_PCT)).item())
    return spreads[groups.size() >= surface.cell_points]


def measure(runs: dict[str, Run], surface: OffSurface) -> list[dict[str, float]]:
    """Numbers of the columns of one sequence. Spreads are medians over the cells that all columns have."""
    if any(run.offsets.empty for run in runs.values()):
        spreads = dict.fromkeys(runs, pd.Series(dtype=float))
    else:
        spreads = {column: cell_spreads(run.offsets, surface) for column, run in runs.items()}
    common = pd.concat(spreads, axis=1, join="inner")
    return [
        {
            "column": column,
            **run.numbers,
            **measure_offsets(run.offsets.get("offset_m", pd.Series(dtype=float)).to_numpy(), surface),
            "spread_m": common[column].median(),
            "cells": len(common),
        }
        for column, run in runs.items()
    ]


def _caption(line: pd.Series) -> str:
    """What a column's numbers are."""
    words = [f"{line['column']}: {line.posed} of {line.frames} frames with pose", f"{line.kept} points"]
    if not np.isnan(line.ate_rmse_m):
        words.insert(1, f"ATE RMSE {1000 * line.ate_rmse_m:.0f} mm")
    if not np.isnan(line.median_m):
        words.append(f"off the surface {100 * line.median_m:.1f} cm (median)")
        words.append(f"{100 * line.p90_m:.1f} cm (90th percentile)")
    if not np.isnan(line.spread_m):
        words.append(f"walls spread {100 * line.spread_m:.1f} cm")
    return ", ".join(words)


def draw(experiment: DirectMap, runs: dict[str, dict[str, Run]], table: pd.DataFrame) -> plt.Figure:
    """A row per sequence: the columns' maps side by side, from above and from the side."""
    rows = []
    for name, columns in runs.items():
        panels = [
            Panel(f"{column}, {view}", run.map, view) for view in AXES for column, run in columns.items()
        ]
        lines = [_caption(line) for _, line in table[table["sequence"] == name].iterrows()]
        heading = f"{name} ({experiment.sequences[name].contents})"
        rows.append(Row("\n".join([heading, *lines]), panels))
    return map_view.draw(rows, WIDTH)


def make_figure(name: str, folders: Folders, tables: Path, figures: Path) -> None:
    """Makes the table and the figure."""
    experiment = config.load_experiment(name)
    runs = {
        sequence: {
            column: read_run(raw / column, path, experiment.points) for column in experiment.columns
        }
        for sequence, (raw, path) in folders.items()
    }
    table = pd.DataFrame(
        {"sequence": sequence, **line}
        for sequence, columns in runs.items()
        for line in measure(columns, experiment.surface)
    )
    text.write_csv(table, tables / f"{name}.csv")
    document = text.render("direct_map.md.j2", experiment=experiment, rows=list(table.itertuples()))
    (tables / f"{name}.md").write_text(document)
    style.save(draw(experiment, runs, table), figures, name)


if __name__ == "__main__":
    map_view.run(__doc__, make_figure)
