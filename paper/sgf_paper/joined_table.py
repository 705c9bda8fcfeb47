"""The paper's Table III whole: our trajectory tables, the paper's rows, and what other systems estimated."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from sgf_paper import config, style, text, trajectory_table
from sgf_paper.deviations import load_deviations
from sgf_paper.style import plt
from sgf_paper.tracking_config import JoinedTable, TableSequence, TrajectoryTable, load_published_rows

KEYS = ["condition", "dataset", "sequence", "system", "quantity"]
LINE = [*KEYS, "measured", "published", "runs"]
UNDISTURBED = "undisturbed"
DATASETS = ["euroc", "euroc_slice", "synthetic"]
# Quantities of a part's line, each by the field it is in and what that is multiplied by.
MEASURED = {
    "ate_mean_m": ("ate_mean_of_successes_mm", 1e-3),
    "ate_rmse_m": ("ate_mm", 1e-3),
    "rpe_1s_m": ("rpe_one_second_mm", 1e-3),
    "coverage_pct": ("posed_pct", 1),
    "success_pct": ("success_pct", 1),
}
PUBLISHED_QUANTITY = "ate_mean_m"
PUBLISHED, REBUILT, BEYOND, EXTERNAL = "published", "measured", "measured, beyond the paper", "other systems"
TIMING = ["dataset", "sequence", "system", "runs", "frames", "median_ms", "p99_ms"]
REASONS = {
    "a": "the sequence is not at hand",
    "b": "the paper has no value",
    "c": "no run succeeds",
    "d": "a sequence of the average has no value",
    "e": "no trajectory of it below results/external",
}
DASHES = [(0, (5, 1.5)), "-", (0, (1, 1)), (0, (6, 1, 1, 1))]
PANEL_COLUMNS = 3
NAN = float("nan")


@dataclass(frozen=True)
class System:
    """A row of the table."""

    name: str
    group: str
    published: str  # its row in the paper's table; empty: none
    column: tuple[str, str] = ("", "")  # the experiment and its column; empty: not ours


def list_systems(joined: JoinedTable, external: list[str]) -> list[System]:
    """All systems in the order of the table. @param external names of other systems."""
    own = [
        System(
            f"{prefix}_{name}", REBUILT if column.published else BEYOND, column.published, (part.name, name)
        )
        for prefix, part in joined.parts.items()
        for name, column in part.columns.items()
    ]
    return [
        *(System(row, PUBLISHED, row) for row in joined.published if row not in external),
        *sorted(own, key=lambda system: system.group == BEYOND),
        *(System(name, EXTERNAL, name if name in joined.published else "") for name in external),
    ]


def _condition(prefix: str, part: TrajectoryTable, name: str) -> str:
    """A change of light has its part's name: each part says itself how strong it is."""
    return UNDISTURBED if name == part.undisturbed else f"{prefix}_{name}"


def _lines(key: dict[str, str], values: dict[str, float], runs: int) -> list[dict]:
    return [{**key, "quantity": name, "measured": value, "runs": runs} for name, value in values.items()]


def part_lines(prefix: str, part: TrajectoryTable, table: pd.DataFrame) -> list[dict]:
    """What a part has measured. @param table its <name>.csv."""
    lines = []
    for row in table.assign(success_pct=100 * table["success_scale"] / table["runs"]).itertuples():
        sequence = part.sequences[row.sequence]
        key = {
            "condition": _condition(prefix, part, row.condition),
            "dataset": sequence.dataset,
            "sequence": sequence.euroc_name,
            "system": f"{prefix}_{row.column}",
        }
        values = {name: factor * getattr(row, field) for name, (field, factor) in MEASURED.items()}
        lines += _lines(key, values, row.runs)
    return lines


def read_external(joined: JoinedTable, files: list[Path]) -> pd.DataFrame:
    """Scores of other systems' trajectories, and whether they have failed by the rule for ours."""
    if not files:
        return pd.DataFrame(columns=["system", "dataset", "sequence", "failed", "ate_mm"])
    table = pd.concat(map(pd.read_csv, files), ignore_index=True)
    posed = table["coverage_pct"] >= joined.rule.lost_below_pct
    near = table["ate_rmse_m"] <= joined.rule.fail_above_pct / 100 * table["path_m"]
    table["failed"] = ~(posed & near & table["success_by_scale"].eq(True))
    table["ate_mm"] = 1000 * table["ate_rmse_m"].mask(table["failed"], np.inf)
    return table


def external_lines(table: pd.DataFrame) -> list[dict]:
    """What other systems' trajectories score, one run each."""
    lines = []
    for row in table.to_dict("records"):
        key = {"condition": UNDISTURBED, **{name: row[name] for name in ("dataset", "sequence", "system")}}
        values = {
            "ate_mean_m": NAN if row["failed"] else row["ate_mean_m"],
            "ate_rmse_m": row["ate_mm"] / 1000,
            "rpe_1s_m": math.inf if row["failed"] else row["rpe_one_second.translation_m"],
            "coverage_pct": row["coverage_pct"],
            "success_pct": 0 if row["failed"] else 100,
        }
        lines += _lines(key, values, 1)
    return lines


def labels_of(joined: JoinedTable) -> dict[str, str]:
    """The paper's names of EuRoC's sequences, by EuRoC's; V2_03's too, which the paper leaves out."""
    return {s.euroc_name: s.published for s in joined.sequences if s.published}


def published_lines(joined: JoinedTable, systems: list[System]) -> list[dict]:
    """The paper's values, all of EuRoC's whole sequences."""
    rows = load_published_rows(joined.rule)
    key = {"condition": UNDISTURBED, "dataset": "euroc", "quantity": PUBLISHED_QUANTITY}
    return [
        {**key, "system": system.name, "sequence": sequence, "published": rows[system.published][label]}
        for system in systems
        if system.published
        for sequence, label in labels_of(joined).items()
        if label in rows[system.published]
    ]


def make_lines(
    joined: JoinedTable, systems: list[System], tables: dict[str, pd.DataFrame], external: pd.DataFrame
) -> pd.DataFrame:
    """The long table, with what is measured and what is published side by side.

    @param tables the parts' lines, by prefix.
    """
    measured = [
        line for prefix, part in joined.parts.items() for line in part_lines(prefix, part, tables[prefix])
    ]
    frame = pd.DataFrame(measured + external_lines(external), columns=[*KEYS, "measured", "runs"])
    published = pd.DataFrame(published_lines(joined, systems), columns=[*KEYS, "published"])
    frame = frame.merge(published, on=KEYS, how="outer")
    orders = {
        "condition": list(dict.fromkeys([UNDISTURBED, *frame["condition"]])),
        "dataset": DATASETS,
        "sequence": list(dict.fromkeys(sequence.euroc_name for sequence in _in_order(joined))),
        "system": [system.name for system in systems],
        "quantity": list(MEASURED),
    }
    frame = frame.sort_values(
        KEYS, key=lambda column: column.map(orders[column.name].index), ignore_index=True
    )
    return frame.fillna({"runs": 0}).astype({"runs": int})[LINE]


def _in_order(joined: JoinedTable) -> list[TableSequence]:
    """Sequences in EuRoC's order, whatever the parts' files begin with."""
    return sorted(joined.sequences, key=lambda sequence: DATASETS.index(sequence.dataset))


def write_lines(lines: pd.DataFrame, tables: Path, name: str) -> None:
    """Writes <name>.csv, of the images as they are, and <name>_light.csv, of changed ones."""
    shown = lines.copy()
    for index, line in lines.iterrows():
        decimals = 6 if line["quantity"].endswith("_m") else 2
        shown.loc[index, "measured"] = text.format_number(line["measured"], decimals)
        shown.loc[index, "published"] = text.format_number(line["published"], 3)
    undisturbed = shown["condition"] == UNDISTURBED
    shown[undisturbed].drop(columns="condition").to_csv(tables / f"{name}.csv", index=False)
    shown[~undisturbed].to_csv(tables / f"{name}_light.csv", index=False)


def read_runs(joined: JoinedTable, tables: Path) -> pd.DataFrame:
    """The runs of all parts, called as the lines are; `folder` is that of a run below the raw results."""
    frames = []
    for prefix, part in joined.parts.items():
        runs = pd.read_csv(tables / f"{part.name}_runs.csv")
        frames.append(runs.assign(
            folder=[
                f"{part.name}/{row.sequence}/run_{row.run}/{row.condition}/{row.column}"
                for row in runs.itertuples()
            ],
            condition=[_condition(prefix, part, name) for name in runs["condition"]],
            dataset=[part.sequences[name].dataset for name in runs["sequence"]],
            sequence=[part.sequences[name].euroc_name for name in runs["sequence"]],
            system=prefix + "_" + runs["column"],
        ))  # fmt: skip
    return pd.concat(frames, ignore_index=True)


def make_timings(runs: pd.DataFrame, raw: Path) -> pd.DataFrame:
    """Time per frame of each system on each sequence, over the frames of all undisturbed runs."""
    lines = []
    own = runs[runs["condition"] == UNDISTURBED]
    for key, rows in own.groupby(["dataset", "sequence", "system"], sort=False):
        times = pd.concat(pd.read_csv(raw / folder / "timings.csv")["total_ms"] for folder in rows["folder"])
        lines.append((*key, len(rows), len(times), *np.percentile(times, [50, 99])))
    return pd.DataFrame(lines, columns=TIMING)


@dataclass(frozen=True)
class Cell:
    """A value of the readable table; empty ones have a reason, a key of REASONS."""

    shown: str
    reason: str = ""


def _error_cell(measured: float, published: float, reason: str) -> Cell:
    """Errors in m. Published ones are in brackets, but in the rows of the paper's own, whose `reason` is b."""
    if reason == "b" and published == published:
        return Cell(f"{published:.3f}")
    beside = [] if published != published else [f"({published:.3f})"]
    if measured != measured:
        return Cell(*(beside or "–"), reason)
    return Cell(" ".join([f"{measured:.4f}", *beside]))


class Grid:
    """The readable table of one data set under one condition."""

    def __init__(self, joined: JoinedTable, systems: list[System], lines: pd.DataFrame, dataset: str) -> None:
        self.labels = labels_of(joined)
        self.rows_of_paper = load_published_rows(joined.rule)
        self.dataset = dataset
        self.condition = lines["condition"].iloc[0]
        own = [system.name for system in systems if system.group in (REBUILT, BEYOND)]
        measured = lines[lines["runs"] > 0]
        self.at_hand = set(measured.loc[measured["system"].isin(own), "sequence"])
        self.sequences = list(self.labels) if dataset == "euroc" else list(dict.fromkeys(lines["sequence"]))
        names = set(lines["system"]) | (set(own) if dataset == "euroc" else set())
        self.systems = [system for system in systems if system.name in names]
        self.values = lines.pivot(index=["system", "quantity"], columns="sequence")

    @property
    def averaged(self) -> list[str]:
        """The sequences that the average is of: those of the paper's table."""
        paper = next(iter(self.rows_of_paper.values()))
        return [name for name in self.sequences if self.labels[name] in paper]

    def _of(self, system: System, quantity: str, field: str) -> pd.Series:
        """Values by sequence, NaN where there is none."""
        values = self.values[field].reindex(columns=self.sequences)
        key = (system.name, quantity)
        return values.loc[key] if key in values.index else pd.Series(NAN, index=self.sequences)

    def _reason(self, system: System, sequence: str, runs: float) -> str:
        """Why nothing is measured."""
        if system.group == PUBLISHED:
            return "b"
        if runs > 0:
            return "c"
        if sequence not in self.at_hand:
            return "a"
        return "e"

    def _average(self, system: System, errors: pd.Series) -> Cell:
        published = NAN
        if self.dataset == "euroc":
            published = self.rows_of_paper.get(system.published, {}).get("avg", NAN)
        reason = "b" if system.group == PUBLISHED else "d"
        return _error_cell(errors[self.averaged].mean(skipna=False), published, reason)

    def _shares(self, system: System) -> list[Cell]:
        """Success and coverage over the sequences that were run."""
        runs = self._of(system, "success_pct", "runs").fillna(0)
        if runs.sum() == 0:
            return [Cell("–", "b" if system.group == PUBLISHED else "a")] * 2
        succeeded = (self._of(system, "success_pct", "measured") * runs / 100).sum()
        coverage = self._of(system, "coverage_pct", "measured").mean()
        return [Cell(f"{succeeded:.0f}/{runs.sum():.0f}"), Cell(f"{coverage:.1f}")]

    def _row(self, system: System) -> dict:
        errors, published, runs = (
            self._of(system, PUBLISHED_QUANTITY, field) for field in ("measured", "published", "runs")
        )
        cells = [
            _error_cell(errors[name], published[name], self._reason(system, name, runs[name]))
            for name in self.sequences
        ]
        cells += [self._average(system, errors), *self._shares(system)]
        published_as = f" ({system.published})" if system.published not in ("", system.name) else ""
        label = system.name + published_as
        return {"system": system, "label": label, "cells": cells}

    def block(self) -> dict:
        """What the templates lay out."""
        rows = [self._row(system) for system in self.systems]
        used = {cell.reason for row in rows for cell in row["cells"]}
        return {
            "title": f"{self.dataset}, {self.condition}",
            "sequences": ["_".join(name.split("_")[:2]) for name in self.sequences],
            "rows": rows,
            "reasons": {key: reason for key, reason in REASONS.items() if key in used},
        }


def make_blocks(joined: JoinedTable, systems: list[System], lines: pd.DataFrame) -> list[dict]:
    """A block of the readable table for each condition and data set."""
    groups = lines.groupby(["condition", "dataset"], sort=False)
    return [Grid(joined, systems, own, dataset).block() for (_, dataset), own in groups]


def line_styles(joined: JoinedTable, systems: list[System]) -> dict[str, dict]:
    """Colours within a part, dashes that tell the parts apart; other systems come after the parts."""
    colours = [*style.COLOURS.values(), *style.EXTRA_COLOURS]
    families: dict[str, list[str]] = {}
    for system in systems:
        own = [prefix for prefix in joined.parts if system.name.startswith(f"{prefix}_")]
        families.setdefault(own[0] if own and system.group in (REBUILT, BEYOND) else "", []).append(
            system.name
        )
    styles = {}
    for place, names in enumerate(families.values()):
        for index, name in enumerate(names):
            dashes = DASHES[(place + index // len(colours)) % len(DASHES)]
            styles[name] = {"color": colours[index % len(colours)], "linestyle": dashes, "linewidth": 1.3}
    return styles


def _place(condition: str, dataset: str) -> tuple:
    """Images as they are come first."""
    return condition != UNDISTURBED, condition, DATASETS.index(dataset)


def draw(joined: JoinedTable, systems: list[System], runs: pd.DataFrame) -> plt.Figure:
    """How many runs stay below an error, a panel per data set and condition."""
    shown = [system for system in systems if system.name in set(runs["system"])]
    styles = line_styles(joined, shown)
    panels = sorted(runs.groupby(["condition", "dataset"]), key=lambda panel: _place(*panel[0]))
    columns = min(PANEL_COLUMNS, len(panels))
    count = -(-len(panels) // columns)
    drawing, axes = plt.subplots(count, columns, figsize=(1 + 3 * columns, 1.2 + 2.7 * count), squeeze=False)
    for axis, ((condition, dataset), own) in zip(axes.flat, panels):
        trajectory_table.draw_curves(axis, own, trajectory_table.error_limits(own), "system", styles)
        sequences = own["sequence"].nunique()
        axis.set_title(f"{dataset}, {condition} (sequences: {sequences})")
    for axis in axes.flat[len(panels) :]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel("runs with a smaller error, %")
    handles = [plt.Line2D([], [], **styles[system.name]) for system in shown]
    drawing.legend(handles, [system.name for system in shown], loc="lower center", ncol=6, frameon=False)
    drawing.suptitle(f"{joined.title}\nruns that fail reach no error")
    bottom = (0.15 + 0.16 * -(-len(shown) // 6)) / drawing.get_figheight()
    drawing.tight_layout(rect=(0, bottom, 1, 1))
    return drawing


def make_joined_table(
    name: str, raw: Path, external: list[Path], left_out: list[str], tables: Path, figures: Path
) -> None:
    """Makes <name>.csv, _light.csv, _timings.csv, .md, .tex and the figure.

    @param external scores of other systems. @param left_out what of theirs has no scores.
    """
    joined = config.load_experiment(name)
    others = read_external(joined, external)
    systems = list_systems(joined, sorted(set(others["system"])))
    parts = {prefix: pd.read_csv(tables / f"{part.name}.csv") for prefix, part in joined.parts.items()}
    lines = make_lines(joined, systems, parts, others)
    write_lines(lines, tables, name)
    own = read_runs(joined, tables)
    text.write_csv(make_timings(own, raw), tables / f"{name}_timings.csv")
    context = {"joined": joined, "blocks": make_blocks(joined, systems, lines), "left_out": left_out}
    for extension in ("md", "tex"):
        document = text.render(f"joined_table.{extension}.j2", notes=load_deviations(), **context)
        (tables / f"{name}.{extension}").write_text(document)
    runs = pd.concat([own, others.assign(condition=UNDISTURBED)], ignore_index=True).astype({"failed": bool})
    style.save(draw(joined, systems, runs), figures, name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="joined table of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="folder of the parts' runs")
    parser.add_argument("--external", type=Path, nargs="*", default=[], help="scores of other systems")
    parser.add_argument("--left-out", nargs="*", default=[], help="theirs whose sequence is not at hand")
    parser.add_argument(
        "--tables", type=Path, required=True, help="folder of the parts' tables and for these"
    )
    parser.add_argument("--figures", type=Path, required=True, help="folder for the figure")
    a = parser.parse_args()
    make_joined_table(a.name, a.raw, a.external, a.left_out, a.tables, a.figures)


if __name__ == "__main__":
    main()
