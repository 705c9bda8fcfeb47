"""Tables I and II from raw scores: CSV files, and the same as Markdown and LaTeX."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from pathlib import Path

import pandas as pd

from sgf_paper import config, scores, text, tuning
from sgf_paper.deviations import load_deviations
from sgf_paper.stereo_config import Sweep, Table, TableBlock, load_published
from sgf_paper.stereo_datasets import read_datasets
from sgf_paper.strict_yaml import read_yaml

CSV_COLUMNS = ["dataset", "region", "matcher", "cost", "quantity", "measured", "published", "scenes"]
CHOICE_COLUMNS = ["dataset", "region", "matcher", "column", "fold", "parameters", "reached"]
NAN = float("nan")
# Options that a sweep gives each scene and grid point, under our names and OpenCV's.
SET_BY_SWEEP = {
    "window", "block_size", "uniqueness_pct", "uniqueness_ratio", "num_disparities", "threads",
}  # fmt: skip
OPENCV_BY_WINDOW = {"p1", "p2"}  # penalties that cv::StereoSGBM's users scale with the window


@dataclass
class Report:
    """Everything a table shows, in the form of its CSV files."""

    fixed: pd.DataFrame
    tuned: pd.DataFrame
    scenes: pd.DataFrame
    wins: pd.DataFrame
    choices: pd.DataFrame  # dataset, region, matcher, and the fields of tuning.Choice


class BlockMaker:
    """Computes one block's part of a table's report from the raw scores of the data sets at hand."""

    def __init__(self, table: Table, block: TableBlock, raw: Path, present: list[str]):
        self.table = table
        self.block = block
        self.sweep = block.sweep
        self.published = load_published(table, block.published)
        self.scores = {name: scores.read_scores(raw, self.sweep, name) for name in present}

    def make(self) -> Report:
        """Computes all parts."""
        fixed = {name: scores.at_fixed(s, self.block) for name, s in self.scores.items()}
        tuned, choices = self._tuned()
        columns = list(self.sweep.columns)
        rows = [row for name, lines in fixed.items() for row in self._dataset_rows(name, lines, columns)]
        if self.table.published_dataset not in self.scores:
            rows += self._published_rows()
        return Report(
            fixed=pd.DataFrame(rows, columns=CSV_COLUMNS),
            tuned=pd.DataFrame(tuned, columns=CSV_COLUMNS),
            scenes=self._scenes(fixed),
            wins=self._wins(fixed),
            choices=choices,
        )

    def _published_value(self, dataset: str, column: str, quantity: str) -> float:
        """The paper's value, given only for the data set that the paper used."""
        if dataset != self.table.published_dataset:
            return NAN
        return self.published.get(quantity, {}).get(column, NAN)

    def _row(self, dataset: str, region: str, column: str, quantity: str, lines: pd.Series) -> dict:
        measured, count = scores.measure(lines, quantity)
        return {
            "dataset": dataset,
            "region": region,
            "matcher": self.sweep.matcher,
            "cost": column,
            "quantity": quantity,
            "measured": measured,
            "published": self._published_value(dataset, column, quantity),
            "scenes": count,
        }

    def _dataset_rows(self, dataset: str, lines: pd.DataFrame, columns: list[str]) -> list[dict]:
        rows = []
        for region in scores.regions_of(lines):
            in_region = lines[lines["region"] == region]
            for column in columns:
                per_scene = in_region[in_region["column"] == column]
                for quantity in self.table.quantities:
                    values = per_scene[scores.score_name(quantity)]
                    rows.append(self._row(dataset, region, column, quantity, values))
        return rows

    def _published_rows(self) -> list[dict]:
        """The paper's values alone; it does not state the region, so they stand under both."""
        nothing = pd.Series(dtype=float)
        return [
            self._row(self.table.published_dataset, region, column, quantity, nothing)
            for region in ("all", "noc")
            for column in self.sweep.main_columns
            for quantity in self.table.quantities
            if quantity in self.published
        ]

    def _tuned(self) -> tuple[list[dict], pd.DataFrame]:
        rows, choices = [], []
        columns = self.sweep.sparse_columns
        for dataset, every in self.scores.items() if self.block.tuning else ():
            every = every[every["column"].isin(columns)]
            folds = folds_of(self.table, every)
            for region in scores.regions_of(every):
                in_region = every[every["region"] == region]
                lines, chosen = tuning.cross_validate(in_region, self.block.tuning, folds)
                if chosen:
                    rows += self._dataset_rows(dataset, lines, columns)
                choices += [
                    (dataset, region, self.sweep.matcher, c.column, c.fold, c.parameters, c.reached)
                    for c in chosen
                ]
        return rows, pd.DataFrame(choices, columns=CHOICE_COLUMNS)

    def _scenes(self, fixed: dict[str, pd.DataFrame]) -> pd.DataFrame:
        lines = pd.concat(fixed.values(), ignore_index=True)
        lines = lines.rename(columns={"column": "cost"})
        kept = [
            "dataset", "scene", "region", "matcher", "cost", "window", "uniqueness",
            "truth_px", "matched_px", *scores.ERRORS, "invalid_pct",
        ]  # fmt: skip
        return lines[kept]

    def _wins(self, fixed: dict[str, pd.DataFrame]) -> pd.DataFrame:
        """Scenes on which a column of the paper has the least error of those columns."""
        quantities = [q for q in self.table.quantities if q in scores.ERRORS]
        rows = []
        for dataset, lines in fixed.items():
            for region in scores.regions_of(lines):
                in_region = lines[lines["region"] == region]
                for quantity in quantities:
                    wins, count = self._count_wins(in_region, quantity)
                    rows += [
                        (dataset, region, self.sweep.matcher, column, quantity, won, count)
                        for column, won in wins.items()
                    ]
        names = ["dataset", "region", "matcher", "cost", "quantity", "won", "scenes"]
        return pd.DataFrame(rows, columns=names)

    def _count_wins(self, lines: pd.DataFrame, quantity: str) -> tuple[dict[str, int], int]:
        """Scenes won by each of the paper's columns (a tie counts for all) and scenes counted."""
        wide = lines.pivot(index="scene", columns="column", values=quantity)
        wide = wide[self.sweep.main_columns].dropna(how="all")
        won = wide.eq(wide.min(axis=1), axis=0).sum()
        return {column: int(won[column]) for column in self.sweep.main_columns}, len(wide)


def folds_of(table: Table, lines: pd.DataFrame) -> dict[str, int]:
    """The fold of each scene of a data set."""
    return tuning.assign_folds(list(lines["scene"].unique()), table.near_duplicates)


def make_report(table: Table, raw: Path, present: list[str]) -> Report:
    """The report of all blocks, sorted by data set and region so that matchers stand together."""
    parts = [BlockMaker(table, block, raw, present).make() for block in table.blocks]
    names = [*present, table.published_dataset]

    def place(column: pd.Series) -> pd.Series:
        order = names if column.name == "dataset" else ["all", "noc"]
        return column.map(order.index)

    def merge(name: str) -> pd.DataFrame:
        frames = [getattr(part, name) for part in parts]
        filled = [frame for frame in frames if not frame.empty]  # empty ones have no types
        frame = pd.concat(filled or frames[:1], ignore_index=True)
        return frame.sort_values(["dataset", "region"], key=place, kind="stable", ignore_index=True)

    return Report(**{part.name: merge(part.name) for part in fields(Report)})


def choice_texts(choices: pd.DataFrame) -> dict[str, dict[str, list[str]]]:
    """Parameters by "data set, region, matcher" and column: one text for each fold they score."""
    texts: dict[str, dict[str, list[str]]] = {}
    for choice in choices.itertuples():
        title = f"{choice.dataset}, {choice.region}, {text.matcher_title(choice.matcher)}"
        columns = texts.setdefault(title, {})
        parameters = choice.parameters
        shown = f"{parameters.window} px, {parameters.uniqueness:g} %{'' if choice.reached else ' *'}"
        columns.setdefault(choice.column, ["–", "–"])[choice.fold] = shown
    return texts


def options_of_columns(raw: Path, sweep: Sweep, dataset: str) -> dict[str, str]:
    """The resolved options of each column but those that the sweep sets, as one line of text."""
    lines = {}
    for column in sweep.columns:
        path = scores.raw_path(raw, sweep.name, dataset, column).with_suffix(".options.yaml")
        options = read_yaml(path)["options"]
        varying = SET_BY_SWEEP | (OPENCV_BY_WINDOW if sweep.columns[column].is_opencv else set())
        fixed = {key: value for key, value in options.items() if key not in varying}
        lines[column] = ", ".join(text.flatten(fixed))
    return lines


def write_csvs(report: Report, out: Path, name: str) -> None:
    """Writes a table's CSV files into folder `out`."""
    text.write_csv(report.fixed, out / f"{name}.csv")
    text.write_csv(report.tuned, out / f"{name}_tuned.csv")
    text.write_csv(report.scenes, out / f"{name}_scenes.csv")
    text.write_csv(report.wins, out / f"{name}_wins.csv")


def make_table(name: str, raw: Path, listing: Path, out: Path) -> None:
    """Makes table `name` from the raw scores in folder `raw`."""
    table = config.load_experiment(name)
    datasets = read_datasets(listing)
    present = table.present(datasets)
    report = make_report(table, raw, present)
    write_csvs(report, out, name)
    main = table.blocks[0].sweep.main_columns
    scenes = report.scenes.groupby("dataset", sort=False)
    context = {
        "table": table,
        "labels": [text.LABELS[quantity] for quantity in table.quantities],
        "absent": table.absent(datasets),
        "fixed": text.make_blocks(report.fixed, report.wins, table.quantities, main),
        "tuned": text.make_blocks(report.tuned, report.wins.iloc[:0], table.quantities, main),
        "choices": choice_texts(report.choices),
        "folds": {dataset: folds_of(table, lines) for dataset, lines in scenes},
        "options": {s.name: options_of_columns(raw, s, present[0]) for s in table.sweeps},
    }
    for extension in ("md", "tex"):
        document = text.render(f"table.{extension}.j2", notes=load_deviations(), **context)
        (out / f"{name}.{extension}").write_text(document)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="table of paper/experiments")
    parser.add_argument("--raw", type=Path, required=True, help="folder of raw scores")
    parser.add_argument("--datasets", type=Path, required=True, help="listing of sgf_eval datasets")
    parser.add_argument("--out", type=Path, required=True, help="folder for the table's files")
    arguments = parser.parse_args()
    make_table(arguments.name, arguments.raw, arguments.datasets, arguments.out)


if __name__ == "__main__":
    main()
