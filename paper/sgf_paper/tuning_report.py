"""What was found for options of a trajectory table's columns, and what it is worth on other sequences."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import pandas as pd

from sgf_paper import config, text
from sgf_paper.strict_yaml import read_yaml


def _line(column: str, fold: dict[str, Any]) -> dict[str, Any]:
    """A line of the table; numbers of runs are those on the held-out fold."""
    training, held_out = fold["training"], fold["held_out"]
    before, after, ratio = (held_out[name] for name in ("default", "tuned", "ratio"))
    return {
        "column": column,
        "trained_on": " ".join(fold["trained_on"]),
        "trial": fold["trial"],
        "training_default_pct": training["default_pct"],
        "training_tuned_pct": training["tuned_pct"],
        "held_out_default_pct": before["error_pct"],
        "held_out_tuned_pct": after["error_pct"],
        "ratio": ratio["median"],
        "ratio_low": ratio["low"],
        "ratio_high": ratio["high"],
        "runs": held_out["runs"],
        "failed_default": before["failed"],
        "failed_tuned": after["failed"],
        **fold["parameters"],
    }


def make_table(documents: dict[str, dict[str, Any]]) -> pd.DataFrame:
    """A line per column and fold. @param documents what was written of each column."""
    folds = [(column, fold) for column, document in documents.items() for fold in document["folds"]]
    return pd.DataFrame([_line(column, fold) for column, fold in folds])


def _row(line: pd.Series) -> dict[str, Any]:
    """A line as text."""
    errors = [name for name in line.index if name.endswith("_pct")]
    return {
        **line,
        **{name: text.format_number(line[name], 3) for name in errors},
        "ratio": text.format_estimate(line["ratio"], line["ratio_low"], line["ratio_high"], 2),
    }


def make_report(name: str, found: Path, tables: Path) -> None:
    """Makes <name>.csv and <name>.md of what was found, a file a column."""
    tuning = config.load_experiment(name)
    documents = {column: read_yaml(found / f"{column}.yaml") for column in tuning.columns}
    table = make_table(documents)
    text.write_csv(table, tables / f"{name}.csv")
    first = next(iter(documents.values()))  # all have the same programs, data and budget
    rows = [_row(line) for _, line in table.iterrows()]
    document = text.render("tuning.md.j2", tuning=tuning, document=first, rows=rows)
    (tables / f"{name}.md").write_text(document)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--found", type=Path, required=True, help="folder of what was found")
    parser.add_argument("--tables", type=Path, required=True, help="folder for the tables")
    a = parser.parse_args()
    make_report(a.name, a.found, a.tables)


if __name__ == "__main__":
    main()
