"""Figure 2: a toy image, its normalised gradient, and the errors of a patch shifted along a line."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd

from sgf_paper import config, images, style
from sgf_paper.study_config import ShiftProfile
from sgf_paper.style import plt

WIDTH = 7.0  # of the figure, inches
ROWS = {"noise_free": "noise-free", "noisy": "noisy"}  # columns of the figure, as in the paper
GREEN = "#00A000"
RED = "#D00000"
LABELS = {name: f"$e_{{\\mathrm{{{name}}}}}$" for name in ("ugf", "mag", "sgf", "photo")}


def gradient_colours(ax: np.ndarray, ay: np.ndarray) -> np.ndarray:
    """RGB of a field of vectors of length up to 1: hue is the direction, brightness the length."""
    hue = (np.arctan2(ay, ax) / (2 * np.pi)) % 1
    length = np.clip(np.hypot(ax, ay), 0, 1)
    return matplotlib.colors.hsv_to_rgb(np.stack([hue, np.ones_like(hue), length], axis=-1))


def _reference(figure: ShiftProfile) -> int:
    """Column of the reference patch's centre."""
    toy = figure.study["toy"]
    return toy["box_width"] * (toy["reference_edge"] + 1)


def _draw_image(axis: plt.Axes, figure: ShiftProfile, image: np.ndarray) -> None:
    """The image with the line in red and the reference patch in green."""
    axis.imshow(image, cmap="gray", vmin=0, vmax=255)
    x, y = _reference(figure), image.shape[0] // 2
    width, height = figure.study["profile"]["patch_width"], figure.study["profile"]["patch_height"]
    axis.axhline(y, color=RED, linewidth=1)
    corner = (x - width / 2, y - height / 2)
    axis.add_patch(plt.Rectangle(corner, width, height, fill=False, color=GREEN, linewidth=1.5))


def _draw_profile(
    axis: plt.Axes, figure: ShiftProfile, profile: pd.DataFrame, minima: pd.DataFrame
) -> None:
    """Error over the place of the shifted patch; circles: minima, filled where least of all."""
    reference = _reference(figure)
    axis.axvline(reference, color=GREEN, linewidth=0.8, linestyle=(0, (2, 2)))
    axis.plot(profile["shift_px"] + reference, profile["error"], color="black", linewidth=1)
    for row in minima.itertuples():
        fill = GREEN if row.least else "none"
        axis.plot(row.shift_px + reference, row.error, "o", color=GREEN, markerfacecolor=fill)
    axis.margins(y=0.2)
    axis.tick_params(labelsize=6)


def _draw_column(
    axes: np.ndarray, figure: ShiftProfile, raw: Path, row: str, tables: dict[str, pd.DataFrame]
) -> None:
    image = images.read_grey(raw / f"{row}.png")
    _draw_image(axes[0], figure, image)
    field = [images.read_pfm(raw / f"{row}_{axis}.pfm") for axis in ("ax", "ay")]
    axes[1].imshow(gradient_colours(*field))
    for axis in axes[:2]:
        axis.set_yticks([])
        axis.set_aspect("auto")
    for axis, metric in zip(axes[2:], figure.study["profile"]["metrics"]):
        own = [t[(t["row"] == row) & (t["metric"] == metric)] for t in tables.values()]
        _draw_profile(axis, figure, *own)
    axes[0].set_title(ROWS[row])
    axes[0].set_xlim(-0.5, image.shape[1] - 0.5)
    axes[-1].set_xlabel("place of the shifted patch, px")


def draw(figure: ShiftProfile, raw: Path) -> plt.Figure:
    """One column of panels noise-free, one noisy, on one horizontal axis."""
    tables = {name: pd.read_csv(raw / f"{name}.csv") for name in ("profiles", "minima")}
    metrics = figure.study["profile"]["metrics"]
    heights = [1.4, 1.4, *[0.85] * len(metrics)]
    drawing, axes = plt.subplots(
        len(heights),
        len(ROWS),
        figsize=(WIDTH, sum(heights) + 0.8),
        sharex=True,
        layout="constrained",
        gridspec_kw={"height_ratios": heights},
    )
    for column, row in zip(axes.T, ROWS):
        _draw_column(column, figure, raw, row, tables)
    labels = ["grey levels", r"$\nabla_{\varepsilon} I$", *(LABELS.get(m, m) for m in metrics)]
    for axis, label in zip(axes[:, 0], labels):
        axis.set_ylabel(label)
    drawing.suptitle(f"{figure.title}\ngreen circles: minima, filled where least of all")
    return drawing


def make_figure(name: str, raw: Path, tables: Path, figures: Path) -> None:
    """Makes <name>.csv (profiles), <name>_minima.csv and the figure."""
    figure = config.load_experiment(name)
    shutil.copyfile(raw / "profiles.csv", tables / f"{name}.csv")
    shutil.copyfile(raw / "minima.csv", tables / f"{name}_minima.csv")
    style.save(draw(figure, raw), figures, name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="folder that sgf_study wrote into")
    parser.add_argument("--tables", type=Path, required=True, help="folder for the tables")
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figure")
    a = parser.parse_args()
    make_figure(a.name, a.raw, a.tables, a.figures)


if __name__ == "__main__":
    main()
