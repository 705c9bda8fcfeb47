"""What is in the rendered stereo-inertial sequences: a sheet of frames and a table of numbers."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from sgf_paper import config
from sgf_paper.images import read_grey
from sgf_paper.style import plt, save
from sgf_paper.text import render

FRAMES_SHOWN = 6


def read_motion(mav0: Path) -> pd.DataFrame:
    """Ground truth with columns time_s, x, y, z, qw, qx, qy, qz, vx, vy, vz."""
    names = ["time_s", "x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz"]
    path = mav0 / "state_groundtruth_estimate0" / "data.csv"
    motion = pd.read_csv(path, skiprows=1, header=None, usecols=range(11), names=names)
    motion["time_s"] *= 1e-9
    return motion


def turn_rates(motion: pd.DataFrame) -> np.ndarray:
    """Angular rates between neighbouring poses, degrees/s."""
    q = motion[["qw", "qx", "qy", "qz"]].to_numpy()
    cosines = np.clip(np.abs(np.sum(q[1:] * q[:-1], axis=1)), 0, 1)
    return np.degrees(2 * np.arccos(cosines)) / np.diff(motion["time_s"])


def measure(folder: Path) -> dict[str, float]:
    """Numbers of one sequence; motion between its first and last image."""
    mav0 = folder / "mav0"
    times = pd.read_csv(mav0 / "cam0" / "times.txt", sep=" ", header=None, names=["id", "s", "ms"])
    motion = read_motion(mav0)
    motion = motion[motion["time_s"].between(times["s"].iloc[0], times["s"].iloc[-1])]
    steps = np.linalg.norm(np.diff(motion[["x", "y", "z"]], axis=0), axis=1)
    levels = [read_grey(path).mean() for path in sorted((mav0 / "cam0" / "data").glob("*.png"))]
    return {
        "frames": len(times),
        "length_m": steps.sum(),
        "max_speed_mps": np.linalg.norm(motion[["vx", "vy", "vz"]], axis=1).max(),
        "max_turn_deg_s": turn_rates(motion).max(),
        "exposure_min_ms": times["ms"].min(),
        "exposure_max_ms": times["ms"].max(),
        "grey_min": min(levels),
        "grey_max": max(levels),
    }


def draw(folders: dict[str, Path]) -> plt.Figure:
    """Left frames at equal intervals, a row a sequence."""
    size = (1.6 * FRAMES_SHOWN, 1.15 * len(folders))
    figure, axes = plt.subplots(len(folders), FRAMES_SHOWN, figsize=size, squeeze=False)
    for row, (name, folder) in zip(axes, folders.items()):
        paths = sorted((folder / "mav0" / "cam0" / "data").glob("*.png"))
        chosen = np.linspace(0, len(paths) - 1, FRAMES_SHOWN).round().astype(int)
        for axis, index in zip(row, chosen):
            axis.imshow(read_grey(paths[index]), cmap="gray", vmin=0, vmax=255)
            axis.set_title(f"{name}, {index / 20:.1f} s", fontsize=6, pad=2)
            axis.axis("off")
    figure.tight_layout(pad=0.3)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="of the experiment")
    parser.add_argument("--sequences", type=Path, required=True, help="folder of the sequences")
    parser.add_argument("--full", action="store_true", help="the full suite")
    parser.add_argument("--tables", type=Path, required=True, help="folder for the table")
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figure")
    arguments = parser.parse_args()
    experiment = config.load_experiment(arguments.name)
    folders = {name: arguments.sequences / name for name in experiment.suite(arguments.full)}
    table = pd.DataFrame({name: measure(folder) for name, folder in folders.items()}).T
    table.index.name = "sequence"
    table.to_csv(arguments.tables / f"{arguments.name}.csv", float_format="%.3f")
    text = render("sequences.md.j2", experiment=experiment, rows=list(table.itertuples()))
    (arguments.tables / f"{arguments.name}.md").write_text(text)
    save(draw(folders), arguments.figures, arguments.name)


if __name__ == "__main__":
    main()
