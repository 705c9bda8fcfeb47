"""Stereo under photometric change: errors before and after, and how much they rise.

Two kinds of change: pairs that a data set itself took under another light, compared with the pair of
the same scene that is unchanged, and a change made to the right image of every pair. Unchanged scores
are those of the tables.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from sgf_paper import config, scores, style, text
from sgf_paper.stereo_config import LightChange, TableBlock
from sgf_paper.stereo_datasets import read_datasets

QUANTITIES = ["mean_px", "bad2_pct", "invalid_pct", "within2_pct"]
KEYS = ["dataset", "region", "case", "matcher", "cost"]
CSV_COLUMNS = [
    *KEYS,
    "scenes",
    "mean_px_median_rise",
    *(f"{q}_{when}" for q in QUANTITIES for when in ("before", "after", "rise")),
]
LIMIT_PX = 10.0  # of the figure's bars
COLOURS = {**style.COLOURS, "census": style.EXTRA_COLOURS[1]}


@dataclass(frozen=True)
class Case:
    """Scores of one matcher on one data set: a line per region, column and scene."""

    name: str
    before: pd.DataFrame  # may be empty
    after: pd.DataFrame


def blocks_of(experiment: LightChange) -> list[TableBlock]:
    """The table's blocks, cut down to the columns of the experiment."""
    blocks = []
    for block in config.load_experiment(experiment.table).blocks:
        columns = {name: block.sweep.columns[name] for name in experiment.columns}
        blocks.append(replace(block, sweep=replace(block.sweep, columns=columns)))
    return blocks


def _fixed(raw: Path, block: TableBlock, dataset: str) -> pd.DataFrame:
    """Scores at each column's fixed parameters, with the share of pixels matched within 2 px."""
    lines = scores.at_fixed(scores.read_scores(raw, block.sweep, dataset), block)
    within = lines["kept_pct"] * (1 - lines["bad2_pct"] / 100)
    return lines.assign(within2_pct=within.fillna(0))  # nothing matched has no error


def _twin_cases(experiment: LightChange, unchanged: pd.DataFrame) -> list[Case]:
    """The data set's own changed pairs; the scene of both is called as the changed one."""
    cases = []
    for changed, twin in experiment.twins.items():
        after = unchanged[unchanged["scene"] == changed]
        before = unchanged[unchanged["scene"] == twin].assign(scene=changed)
        if not after.empty:
            cases.append(Case(changed, before, after))
    return cases


def cases_of(experiment: LightChange, block: TableBlock, raw: Path, dataset: str) -> list[Case]:
    """All cases of a matcher on a data set."""
    unchanged = _fixed(raw, block, dataset)
    made = [
        Case(change, unchanged, _fixed(raw / experiment.name / change, block, dataset))
        for change in experiment.changes
    ]
    return _twin_cases(experiment, unchanged) + made


def compare(before: pd.Series, after: pd.Series) -> dict[str, float]:
    """Means over scenes, and the rise, over those scenes that have a score before and after.

    Scores before may be missing altogether: then there is only an after.
    """
    if before.isna().all():
        return {"before": float("nan"), "after": float(after.mean()), "rise": float("nan")}
    both = before.notna() & after.notna()
    values = {"before": float(before[both].mean()), "after": float(after[both].mean())}
    return {**values, "rise": values["after"] - values["before"]}


def _case_lines(case: Case) -> list[dict]:
    """Per region and column what the case did to each quantity."""
    keys = ["region", "column", "scene"]
    joined = case.after.merge(case.before, "left", on=keys, suffixes=("_after", "_before"))
    lines = []
    for (region, column), scenes in joined.groupby(["region", "column"], sort=False):
        line = {"region": region, "case": case.name, "cost": column}
        line["scenes"] = int(scenes["mean_px_after"].notna().sum())
        rises = (scenes["mean_px_after"] - scenes["mean_px_before"]).dropna()
        line["mean_px_median_rise"] = float("nan") if rises.empty else rises.median()
        for quantity in QUANTITIES:
            values = compare(scenes[f"{quantity}_before"], scenes[f"{quantity}_after"])
            line |= {f"{quantity}_{when}": value for when, value in values.items()}
        lines.append(line)
    return lines


def make_table(experiment: LightChange, raw: Path, datasets: list[str]) -> pd.DataFrame:
    """All lines, in the order of data sets, regions, cases, matchers and columns."""
    lines = [
        {"dataset": dataset, "matcher": block.sweep.matcher, **line}
        for dataset in datasets
        for block in blocks_of(experiment)
        for case in cases_of(experiment, block, raw, dataset)
        for line in _case_lines(case)
    ]
    table = pd.DataFrame(lines, columns=CSV_COLUMNS)
    order = {
        "dataset": datasets,
        "region": ["all", "noc"],
        "case": [*experiment.twins, *experiment.changes],
    }
    ranks = table[list(order)].apply(lambda names: names.map(order[names.name].index))
    return table.loc[ranks.sort_values(list(order), kind="stable").index].reset_index(drop=True)


def _format(value: float) -> str:
    return text.format_number(round(value, 2) + 0.0, 2) or "–"  # + 0: no "-0.00"


def _row(line: pd.Series, least: float) -> dict:
    values = {
        quantity: [_format(line[f"{quantity}_{when}"]) for when in ("before", "after", "rise")]
        for quantity in QUANTITIES
    }
    if line["mean_px_rise"] == least:
        values["mean_px"][2] = f"**{values['mean_px'][2]}**"
    values["mean_px"].append(_format(line["mean_px_median_rise"]))
    return {"matcher": line["matcher"], "cost": line["cost"], "scenes": line["scenes"], "values": values}


def make_blocks(table: pd.DataFrame) -> list[dict]:
    """The table as text: a block per data set, region and case."""
    blocks = []
    for (dataset, region, case), part in table.groupby(["dataset", "region", "case"], sort=False):
        least = part.groupby("matcher")["mean_px_rise"].transform("min")
        rows = [_row(line, least[index]) for index, line in part.iterrows()]
        blocks.append({"dataset": dataset, "region": region, "case": case, "rows": rows})
    return blocks


def _label(axis: plt.Axes, label: str, place: float, height: float, shift: int, colour: str) -> None:
    """Text centred at a place, some points above or below a height."""
    where = {"textcoords": "offset points", "ha": "center", "annotation_clip": False}
    axis.annotate(label, (place, height), (0, shift), color=colour, **where)


def _draw_panel(axis: plt.Axes, lines: pd.DataFrame) -> None:
    """Two bars a column, before and after, the rise above them."""
    for place, line in enumerate(lines.itertuples()):
        before, after = (min(value, LIMIT_PX) for value in (line.mean_px_before, line.mean_px_after))
        axis.bar(place - 0.2, before, 0.38, color=COLOURS[line.cost], alpha=0.4)
        axis.bar(place + 0.2, after, 0.38, color=COLOURS[line.cost])
        rise = round(line.mean_px_rise, 2) + 0.0  # + 0: no "-0.00"
        _label(axis, f"{rise:+.2f}", place, max(before, after), 2, "black")
        _label(axis, f"{line.invalid_pct_after:.0f} %", place, 0, -21, "#555555")
    axis.set_xticks(range(len(lines)), lines["cost"])
    axis.tick_params(axis="x", length=0)
    axis.margins(y=0.14)
    axis.grid(axis="y", alpha=0.3, linewidth=0.5)
    axis.set_axisbelow(True)


def draw(experiment: LightChange, table: pd.DataFrame) -> plt.Figure:
    """Mean errors before and after on the table's first data set and region: a row of panels per
    case that has a before, in it the matchers."""
    shown = table[(table["dataset"] == table["dataset"][0]) & (table["region"] == table["region"][0])]
    shown = shown[shown["mean_px_rise"].notna()]
    cases, matchers = shown["case"].unique(), shown["matcher"].unique()
    size = (3.6 * len(matchers), 2.0 * len(cases) + 0.8)
    figure, axes = plt.subplots(
        len(cases), len(matchers), figsize=size, sharey="row", squeeze=False, layout="constrained"
    )
    for row, case in zip(axes, cases):
        for axis, matcher in zip(row, matchers):
            lines = shown[(shown["case"] == case) & (shown["matcher"] == matcher)]
            _draw_panel(axis, lines)
            scenes = lines["scenes"].max()
            title = f"{text.matcher_title(matcher)}: {case}, {scenes} scene{'s' if scenes != 1 else ''}"
            axis.set_title(title)
        row[0].set_ylabel("mean error, px")
    first = table.iloc[0]
    figure.suptitle(
        f"{experiment.title}: {first['dataset']}, {first['region']}\n"
        f"pale: unchanged; full: changed; above: rise, px; bars end at {LIMIT_PX:g} px;"
        " below: pixels left unmatched after the change"
    )
    return figure


def make_light_change(name: str, raw: Path, listing: Path, tables: Path, figures: Path) -> None:
    """Makes <name>.csv, <name>.md and the figure."""
    experiment = config.load_experiment(name)
    table = make_table(experiment, raw, experiment.present(read_datasets(listing)))
    text.write_csv(table, tables / f"{name}.csv")
    document = text.render(
        "light_change.md.j2",
        experiment=experiment,
        fixed=[(block.sweep.matcher, block.fixed, block.fixed_of) for block in blocks_of(experiment)],
        blocks=make_blocks(table),
    )
    (tables / f"{name}.md").write_text(document)
    style.save(draw(experiment, table), figures, name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="folder of raw scores")
    parser.add_argument("--datasets", type=Path, required=True, help="listing of sgf_eval datasets")
    parser.add_argument("--tables", type=Path, required=True, help="folder for CSV and Markdown")
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figure")
    a = parser.parse_args()
    make_light_change(a.name, a.raw, a.datasets, a.tables, a.figures)


if __name__ == "__main__":
    main()
