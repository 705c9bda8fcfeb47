"""Figures 4 and 5: image, ground truth and the disparities of some columns of several matchers."""

from __future__ import annotations

import argparse
import itertools
import subprocess
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import yaml

from sgf_paper import config, images, style, text
from sgf_paper.stereo_config import DisparityFigure, FigureScene, Parameters, Sweep, TableBlock
from sgf_paper.stereo_datasets import read_datasets

WIDTH = 10.0  # of a figure, inches
WIDE = 2.5  # aspect from which image and truth stand above the maps instead of beside them
MAP = matplotlib.colormaps["viridis"].with_extremes(bad="black")


@dataclass(frozen=True)
class Scene:
    """What is drawn of one stereo pair; disparities in px, NaN for none."""

    name: str
    image: np.ndarray
    truth: np.ndarray
    maps: dict[str, list[np.ndarray]]  # by the matcher's title, one per column


@dataclass(frozen=True)
class Panel:
    title: str
    picture: np.ndarray
    grey: bool = False  # an image, not disparities


def matcher_command(
    program: Path, folder: Path, scene: FigureScene, sweep: Sweep, column: str, at: Parameters
) -> list[str]:
    """Call of sgf_stereo that matches a scene as the sweep's column, but for output and options."""
    count = scene.num_disparities or images.read_num_disparities(folder / scene.calibration)
    flags = {
        "gt": folder / scene.truth,
        "method": sweep.columns[column].implementation,
        "max-disp": count,
        "window": at.window,
    }
    if len(sweep.grid.uniqueness) > 1:  # else the method may not have it
        flags["uniqueness"] = at.uniqueness
    command = [str(program), str(folder / scene.left), str(folder / scene.right)]
    for flag, value in flags.items():
        command += [f"--{flag}", str(value)]
    return [*command, "--fill"] if sweep.columns[column].fill else command


def _match_columns(
    block: TableBlock, columns: list[str], folder: Path, scene: FigureScene, program: Path, work: Path
) -> list[np.ndarray]:
    """Runs sgf_stereo for some columns of a sweep and reads what it wrote below `work`."""
    maps = []
    for column in columns:
        out = work / block.sweep.name / column
        out.mkdir(parents=True, exist_ok=True)
        options = out / "column.yaml"
        options.write_text(yaml.safe_dump(block.sweep.column_options(column)))
        at = block.parameters(column)
        command = matcher_command(program, folder, scene, block.sweep, column, at)
        subprocess.run([*command, "--config", str(options), "-o", str(out)], check=True)
        maps.append(images.read_disparity(out / "disparity.pfm"))
    return maps


def load_scene(
    figure: DisparityFigure, folder: Path, scene: FigureScene, program: Path, work: Path
) -> Scene:
    """Reads a scene's files and matches it by every column of every sweep."""
    table = config.load_experiment(figure.parameters_of)
    maps = {}
    for name in figure.sweeps:
        block = table.block(name)
        title = text.matcher_title(block.sweep.matcher)
        work_here = work / scene.name
        maps[title] = _match_columns(block, figure.columns, folder, scene, program, work_here)
    image = images.read_grey(folder / scene.left)
    return Scene(scene.name, image, images.read_disparity(folder / scene.truth), maps)


def _share_kept(disparity: np.ndarray, truth: np.ndarray) -> float:
    known = np.isfinite(truth)
    return 100.0 * np.isfinite(disparity[known]).mean()


def _arrange(scene: Scene, columns: list[str], wide: bool) -> list[list[Panel | None]]:
    """Rows of panels: one for each matcher, image and truth in front of them, or above where wide."""
    lead = [
        Panel(f"{scene.name}, image", scene.image, grey=True),
        Panel("ground truth", scene.truth),
    ]
    rows = [
        [
            Panel(f"{matcher}, {column} ({_share_kept(disparity, scene.truth):.0f} % kept)", disparity)
            for column, disparity in zip(columns, maps)
        ]
        for matcher, maps in scene.maps.items()
    ]
    blank = [None] * len(columns)
    if wide:
        return [(lead + blank)[: max(len(lead), len(columns))], *rows]
    return [[front, *(row or blank)] for front, row in itertools.zip_longest(lead, rows)]


def _draw_scene(axes: np.ndarray, panels: list[list[Panel | None]], largest: float) -> None:
    """Maps on one colour scale; pixels without a value are black."""
    for axis, panel in itertools.zip_longest(axes.ravel(), itertools.chain(*panels)):
        axis.set_axis_off()
        if panel is None:
            continue
        axis.set_title(panel.title)
        if panel.grey:
            axis.imshow(panel.picture, cmap="gray", vmin=0, vmax=255)
            continue
        shown = axis.imshow(panel.picture, cmap=MAP, vmin=0, vmax=largest, interpolation="nearest")
    axes[0, 0].figure.colorbar(shown, ax=axes, label="disparity, px", pad=0.01, aspect=30)


def draw(scenes: list[Scene], columns: list[str]) -> plt.Figure:
    """The panels of all scenes, one scene below the other."""
    aspects = [scene.truth.shape[1] / scene.truth.shape[0] for scene in scenes]
    panels = [_arrange(scene, columns, aspects[0] >= WIDE) for scene in scenes]
    rows, abreast = len(panels[0]), len(panels[0][0])
    heights = [WIDTH / (abreast + 0.4) / aspect + 0.25 for aspect in aspects]
    drawing, axes = plt.subplots(
        rows * len(scenes),
        abreast,
        figsize=(WIDTH, rows * sum(heights) + 0.3),
        squeeze=False,
        layout="constrained",
        gridspec_kw={"height_ratios": np.repeat(heights, rows)},
    )
    for index, scene in enumerate(scenes):
        own = axes[rows * index : rows * (index + 1)]
        _draw_scene(own, panels[index], np.nanmax(scene.truth))
    return drawing


def make_figure(name: str, listing: Path, program: Path, work: Path, out: Path) -> None:
    """Matches the scenes at hand and draws figure `name`."""
    figure = config.load_experiment(name)
    datasets = read_datasets(listing)
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
