"""Figures 4 and 5: image, ground truth and the disparities of some columns, one row per scene."""

from __future__ import annotations

import argparse
import subprocess
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import yaml

from sgf_paper import config, images, style
from sgf_paper.config import DisparityFigure, FigureScene, Parameters, Sweep

WIDTH = 10.0  # of a figure, inches
WIDE = 2.5  # aspect from which images stand two abreast
MAP = matplotlib.colormaps["viridis"].with_extremes(bad="black")


@dataclass(frozen=True)
class Scene:
    """What is drawn of one stereo pair; disparities in px, NaN for none."""

    name: str
    image: np.ndarray
    truth: np.ndarray
    maps: list[np.ndarray]  # one per column


def matcher_command(
    program: Path, folder: Path, scene: FigureScene, sweep: Sweep, column: str, at: Parameters
) -> list[str]:
    """Call of sgf_stereo that matches a scene as the sweep's column, but for output and options."""
    count = scene.num_disparities or images.read_num_disparities(folder / scene.calibration)
    method = {"block_matcher": "bm", "opencv_bm": "opencv_bm"}[sweep.columns[column].implementation]
    flags = {
        "gt": folder / scene.truth,
        "method": method,
        "max-disp": count,
        "window": at.window,
        "uniqueness": at.uniqueness,
    }
    command = [str(program), str(folder / scene.left), str(folder / scene.right)]
    for flag, value in flags.items():
        command += [f"--{flag}", str(value)]
    return command


def _match_columns(
    figure: DisparityFigure, folder: Path, scene: FigureScene, program: Path, work: Path
) -> list[np.ndarray]:
    """Runs sgf_stereo for each column of the figure and reads what it wrote below `work`."""
    sweep = config.load_sweep(figure.sweep)
    table = config.load_experiment(figure.parameters_of)
    maps = []
    for column in figure.columns:
        out = work / scene.name / column
        out.mkdir(parents=True, exist_ok=True)
        options = out / "column.yaml"
        options.write_text(yaml.safe_dump(sweep.column_options(column)))
        command = matcher_command(program, folder, scene, sweep, column, table.parameters(column))
        subprocess.run([*command, "--config", str(options), "-o", str(out)], check=True)
        maps.append(images.read_disparity(out / "disparity.pfm"))
    return maps


def load_scene(
    figure: DisparityFigure, folder: Path, scene: FigureScene, program: Path, work: Path
) -> Scene:
    """Reads a scene's files and matches it by every column."""
    maps = _match_columns(figure, folder, scene, program, work)
    image = images.read_grey(folder / scene.left)
    return Scene(scene.name, image, images.read_disparity(folder / scene.truth), maps)


def _share_kept(disparity: np.ndarray, truth: np.ndarray) -> float:
    known = np.isfinite(truth)
    return 100.0 * np.isfinite(disparity[known]).mean()


def _draw_scene(axes: np.ndarray, scene: Scene, columns: list[str]) -> None:
    """Image, truth and maps on one colour scale; pixels without a value are black."""
    largest = np.nanmax(scene.truth)
    titles = ["ground truth"]
    for column, disparity in zip(columns, scene.maps):
        titles.append(f"{column} ({_share_kept(disparity, scene.truth):.0f} % kept)")
    axes[0].imshow(scene.image, cmap="gray", vmin=0, vmax=255)
    axes[0].set_title(f"{scene.name}, image")
    for axis, title, disparity in zip(axes[1:], titles, [scene.truth, *scene.maps]):
        shown = axis.imshow(disparity, cmap=MAP, vmin=0, vmax=largest, interpolation="nearest")
        axis.set_title(title)
    for axis in axes:
        axis.set_axis_off()
    axes[0].figure.colorbar(shown, ax=list(axes), label="disparity, px", pad=0.01, aspect=12)


def draw(scenes: list[Scene], columns: list[str]) -> plt.Figure:
    """Lays out the panels of each scene in one row, or two abreast where images are wide."""
    panels = 2 + len(columns)
    aspect = scenes[0].truth.shape[1] / scenes[0].truth.shape[0]
    abreast = panels if aspect < WIDE else 2
    rows = -(-panels // abreast)
    heights = [WIDTH / (abreast + 0.4) / s.truth.shape[1] * s.truth.shape[0] + 0.25 for s in scenes]
    drawing, axes = plt.subplots(
        rows * len(scenes),
        abreast,
        figsize=(WIDTH, rows * sum(heights) + 0.3),
        squeeze=False,
        layout="constrained",
        gridspec_kw={"height_ratios": np.repeat(heights, rows)},
    )
    for index, scene in enumerate(scenes):
        _draw_scene(axes[rows * index : rows * (index + 1)].ravel(), scene, columns)
    return drawing


def make_figure(name: str, listing: Path, program: Path, work: Path, out: Path) -> None:
    """Matches the scenes at hand and draws figure `name`."""
    figure = config.load_experiment(name)
    datasets = config.read_datasets(listing)
    group = figure.group(datasets)
    folder = datasets[group.dataset].folder
    scenes = [load_scene(figure, folder, scene, program, work / name) for scene in group.scenes]
    drawing = draw(scenes, figure.columns)
    drawing.suptitle(f"{figure.title}: {group.title}; black: no value")
    style.save(drawing, out, name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="figure of paper/experiments")
    parser.add_argument("--datasets", type=Path, required=True, help="listing of sgf_eval datasets")
    parser.add_argument("--program", type=Path, required=True, help="sgf_stereo")
    parser.add_argument("--work", type=Path, required=True, help="folder for the disparity maps")
    parser.add_argument("--out", type=Path, required=True, help="folder for the figure")
    a = parser.parse_args()
    make_figure(a.name, a.datasets, a.program, a.work, a.out)


if __name__ == "__main__":
    main()
