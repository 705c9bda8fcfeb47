"""Figure 1: disparity errors of images against changed copies of themselves, by dissimilarity."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd

from sgf_paper import config, images, style, text
from sgf_paper.study_config import FrameGroup, SelfMatch, load_published_errors
from sgf_paper.style import plt

WIDTH = 10.0  # of a figure, inches
LEVELS_PER_PX = 10  # of an error picture
NOT_SCORED = 255  # in an error picture
ERROR_LIMIT_PX = 10  # where the colours end
MAP = matplotlib.colormaps["viridis"].with_extremes(bad="white")
COLOURS = {
    "photo": style.COLOURS["sad"],
    "ncc": "#000000",
    "mag": style.COLOURS["agm"],
    "gom": "#CC79A7",
    "pm": style.COLOURS["pm"],
    "ugf": "#0072B2",
    "sgf": style.COLOURS["sgf"],
}
KEYS = ["group", "frame", "cost", "extra", "first_disparity", "end_disparity"]
SCORES = ["pixels", "mean_px", "first_px", "median_px", "bad1_pct", "ties_pct"]
CASE_COLUMNS = [*KEYS[:2], "case", *KEYS[2:], *SCORES, "published"]
CURVE_COLUMNS = [*KEYS[:2], "change", "value", *KEYS[2:], *SCORES]
AXES = {
    "vignette": "vignette strength $v$ of $1 - v r^2$",
    "exposure": "exposure ratio",
    "offset": "offset, grey levels",
    "noise": "noise on both images, grey levels",
    "blur": "blur, px",
    "light": "strength of a local light",
}


def groups_of(figure: SelfMatch, names: list[str]) -> list[FrameGroup]:
    """The groups whose frames are all among `names` (`group_frame`)."""
    return [g for g in figure.groups if all(f"{g.name}_{label}" in names for label in g.frames)]


def read_scores(figure: SelfMatch, groups: list[FrameGroup], raw: Path) -> pd.DataFrame:
    """What sgf_study wrote for the groups' frames, with group, frame and extra as columns."""
    parts = []
    for group in groups:
        for label in group.frames:
            part = pd.read_csv(raw / f"{group.name}_{label}.csv")
            parts.append(part.assign(group=group.name, frame=label))
    scores = pd.concat(parts, ignore_index=True).rename(columns={"column": "cost"})
    scores["extra"] = [figure.columns[cost].extra for cost in scores["cost"]]
    return scores


def case_table(figure: SelfMatch, scores: pd.DataFrame) -> pd.DataFrame:
    """The cases' lines. The paper's values stand beside its own frames' in its range only."""
    lines = scores["change"].isin(figure.cases) & scores["value"].isna()
    table = scores[lines].rename(columns={"change": "case"})
    published = load_published_errors(figure)
    paper = next((g for g in figure.groups if g.name == figure.published_group), None)
    values = []
    for row in table.itertuples():
        errors = published.get(row.cost)
        own = paper and row.group == paper.name and is_papers_range(figure, row) and errors
        values.append(errors[list(paper.frames).index(row.frame)] if own else np.nan)
    return table.assign(published=values)[CASE_COLUMNS]


def curve_table(figure: SelfMatch, scores: pd.DataFrame) -> pd.DataFrame:
    """The curves' lines."""
    lines = scores["change"].isin(figure.curves) & scores["value"].notna()
    return scores[lines][CURVE_COLUMNS]


def is_papers_range(figure: SelfMatch, row: object) -> bool:
    """Whether a line is of the first range, which is the paper's."""
    return [row.first_disparity, row.end_disparity] == figure.matching["ranges"][0]


def read_errors(path: Path) -> np.ndarray:
    """Errors in px of an error picture, NaN where a pixel was not scored."""
    levels = images.read_grey(path)
    return np.where(levels == NOT_SCORED, np.nan, levels / LEVELS_PER_PX)


def _joined(values: pd.Series, decimals: int) -> str:
    return " / ".join(text.format_number(value, decimals) for value in values)


def _row(figure: SelfMatch, lines: pd.DataFrame, cost: str) -> dict[str, str]:
    """One dissimilarity in one case: values of the frames, in the first range and the others."""
    own = lines[lines["cost"] == cost]
    first = own[[is_papers_range(figure, row) for row in own.itertuples()]]
    published = load_published_errors(figure).get(cost, [])
    others = own.drop(first.index).groupby(["first_disparity", "end_disparity"], sort=False)
    return {
        "cost": cost + (" (extra)" if figure.columns[cost].extra else ""),
        "mean": _joined(first["mean_px"], 2),
        "published": _joined(pd.Series(published, dtype=float), 2) or "–",
        "ties": _joined(first["ties_pct"], 1),
        "first": _joined(first["first_px"], 2),
        "median": _joined(first["median_px"], 1),
        "bad1": _joined(first["bad1_pct"], 1),
        "others": [_joined(part["mean_px"], 2) for _, part in others],
    }


def make_blocks(figure: SelfMatch, groups: list[FrameGroup], cases: pd.DataFrame) -> list[dict]:
    """One table per group and case as text; dissimilarities by mean error, the least first."""
    blocks = []
    for group in groups:
        for case in figure.cases:
            lines = cases[(cases["group"] == group.name) & (cases["case"] == case)]
            first = lines[[is_papers_range(figure, row) for row in lines.itertuples()]]
            order = first.groupby("cost", sort=False)["mean_px"].mean().sort_values().index
            rows = [_row(figure, lines, cost) for cost in order]
            pixels = int(first["pixels"].iloc[0])
            blocks.append({"group": group, "case": case, "rows": rows, "pixels": pixels})
    return blocks


def _panels(figure: SelfMatch, folder: Path) -> dict[str, np.ndarray]:
    """Pictures of the figure's case in the order of the panels, by title."""
    case = folder / figure.figure_case
    names = figure.figure_columns
    errors = [(name, read_errors(case / f"{name}.png")) for name in names]
    half = -(-len(names) // 2)
    return {
        "image": images.read_grey(case / "left.png"),
        **dict(errors[:half]),
        "modified image": images.read_grey(case / "right.png"),
        **dict(errors[half:]),
    }


def _draw_panel(axis: plt.Axes, title: str, picture: np.ndarray, mean_px: float | None) -> None:
    axis.set_title(title)
    axis.set_xticks([])
    axis.set_yticks([])
    if mean_px is None:
        axis.imshow(picture, cmap="gray", vmin=0, vmax=255)
    else:
        axis.imshow(picture, cmap=MAP, vmin=0, vmax=ERROR_LIMIT_PX, interpolation="nearest")
        axis.set_xlabel(f"{mean_px:.2f} px")


def _draw_frame(axes: np.ndarray, panels: dict[str, np.ndarray], means: pd.Series) -> None:
    for axis in axes.flat[len(panels) :]:
        axis.set_visible(False)
    for axis, (title, picture) in zip(axes.flat, panels.items()):
        _draw_panel(axis, title, picture, means.get(title))


def draw(figure: SelfMatch, group: FrameGroup, cases: pd.DataFrame, raw: Path) -> plt.Figure:
    """Per frame of the group: the images matched and the errors of the paper's columns."""
    frames = {label: _panels(figure, raw / f"{group.name}_{label}") for label in group.frames}
    shape = next(iter(frames.values()))["image"].shape
    columns = -(-len(next(iter(frames.values()))) // 2)
    panel_height = WIDTH / columns * shape[0] / shape[1] + 0.35
    size = (WIDTH, 2 * len(frames) * panel_height + 0.3)
    drawing, axes = plt.subplots(
        2 * len(frames), columns, figsize=size, squeeze=False, layout="constrained"
    )
    in_case = cases[cases["case"] == figure.figure_case]
    first = in_case[[is_papers_range(figure, row) for row in in_case.itertuples()]]
    for index, (label, panels) in enumerate(frames.items()):
        lines = first[(first["group"] == group.name) & (first["frame"] == label)]
        means = lines.set_index("cost")["mean_px"]
        _draw_frame(axes[2 * index : 2 * index + 2], panels, means)
        axes[2 * index][0].set_ylabel(f"frame {label}")
    scale = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(0, ERROR_LIMIT_PX), MAP)
    drawing.colorbar(
        scale, ax=axes, label="disparity error, px", extend="max", aspect=40, pad=0.01
    )
    drawing.suptitle(f"{figure.title}: {group.title}")
    return drawing


def line_style(figure: SelfMatch, cost: str) -> dict:
    """An extra column is dashed, in the colour of the paper's column of the same dissimilarity."""
    column = figure.columns[cost]
    if not column.extra:
        return {"color": COLOURS[cost], "linewidth": 1.6 if cost in ("sgf", "pm") else 1.2}
    return {"color": COLOURS.get(column.metric, "#999999"), "linewidth": 1.0, "linestyle": (0, (3, 2))}


def _draw_curve(axis: plt.Axes, figure: SelfMatch, change: str, lines: pd.DataFrame) -> None:
    for cost in figure.columns:
        own = lines[lines["cost"] == cost].groupby("value")["mean_px"].mean()
        axis.plot(own.index, own, label=cost, marker=".", markersize=3, **line_style(figure, cost))
    axis.set_xlabel(AXES[change])
    axis.set_yscale("symlog", linthresh=0.1, linscale=0.4)
    axis.set_ylim(0, 12)
    axis.set_yticks([0, 0.1, 1, 10], ["0", "0.1", "1", "10"])
    axis.grid(alpha=0.3, linewidth=0.5)


def draw_curves(figure: SelfMatch, group: FrameGroup, curves: pd.DataFrame) -> plt.Figure:
    """Error against the strength of each change alone, mean over the group's frames."""
    rows = -(-len(figure.curves) // 3)
    size = (WIDTH, 2.6 * rows + 0.7)
    drawing, axes = plt.subplots(rows, 3, figsize=size, sharey=True, squeeze=False)
    own = curves[curves["group"] == group.name]
    for axis, change in zip(axes.flat, figure.curves):
        _draw_curve(axis, figure, change, own[own["change"] == change])
    for axis in axes[:, 0]:
        axis.set_ylabel("mean error, px")
    handles, labels = axes[0][0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="lower center", ncol=len(labels), frameon=False)
    drawing.suptitle(f"{figure.title}: one change at a time; {group.title}")
    drawing.tight_layout(rect=(0, 0.05, 1, 1))
    return drawing


def make_figure(name: str, raw: Path, frames: list[str], tables: Path, figures: Path) -> None:
    """Makes the tables of all groups, and the figures of the first."""
    figure = config.load_experiment(name)
    groups = groups_of(figure, frames)
    scores = read_scores(figure, groups, raw)
    cases, curves = case_table(figure, scores), curve_table(figure, scores)
    text.write_csv(cases, tables / f"{name}.csv")
    text.write_csv(curves, tables / f"{name}_curves.csv")
    document = text.render(
        "self_match.md.j2", figure=figure, blocks=make_blocks(figure, groups, cases)
    )
    (tables / f"{name}.md").write_text(document)
    style.save(draw(figure, groups[0], cases, raw), figures, name)
    style.save(draw_curves(figure, groups[0], curves), figures, f"{name}_curves")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="folder that sgf_study wrote into")
    parser.add_argument("--frames", nargs="+", required=True, help="frames at hand, group_frame")
    parser.add_argument("--tables", type=Path, required=True, help="folder for the tables")
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figures")
    a = parser.parse_args()
    make_figure(a.name, a.raw, a.frames, a.tables, a.figures)


if __name__ == "__main__":
    main()
