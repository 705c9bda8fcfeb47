"""What the report shows and claims."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Union

from sgf_paper import paths
from sgf_paper.experiment import Experiment
from sgf_paper.strict_yaml import ConfigError, build, read_yaml


@dataclass(frozen=True)
class ReportTable:
    """Lines of a CSV file that the report shows."""

    table: str  # tables/<table>.csv
    title: str
    columns: list[str] = field(default_factory=list)  # empty: all
    where: dict[str, Any] = field(default_factory=dict)  # values of columns, or lists of them
    empty: dict[str, str] = field(default_factory=dict)  # why cells of a column may be empty
    run: str = ""  # below the results, what made a line; {column} is a value of the line
    only_html: bool = False  # long: not printed in the PDF


@dataclass(frozen=True)
class ReportItem:
    """A table or figure, made by the experiment of the same name."""

    name: str
    place: str  # in the paper; empty for what it does not have
    about: str
    figures: list[str] = field(default_factory=list)  # figures/<figure>.png and .pdf
    latex: list[str] = field(default_factory=list)  # tables/<table>.tex
    tables: list[ReportTable] = field(default_factory=list)


@dataclass(frozen=True)
class ReportPairs:
    """Methods that are compared with each other, pair by pair."""

    name: str  # experiment that has the methods
    table: str  # tables/<table>.csv: a line a method and run, or scene
    title: str
    method: str  # column that names the method
    quantity: str  # column of the error
    groups: list[str]  # columns: each of their values is compared by itself
    pairs: list[str]  # columns that two lines of a pair share
    clusters: dict[str, list[str]]  # by name the columns whose values are independent draws
    run: str = ""  # below the results, what made a method's errors; {column} is a group or the method


@dataclass
class Report(Experiment):
    """What the report shows, and what counts as decided."""

    datasets: dict[str, str]  # what each is
    verdict_clusters: int  # fewer independent pairs give no verdict
    margin_pct: float  # ratios nearer to 1 are equal
    items: list[ReportItem]
    pairs: list[ReportPairs]

    def check(self, where: str) -> None:
        for name in [part.name for part in (*self.items, *self.pairs)]:
            if not (paths.EXPERIMENTS / f"{name}.yaml").exists():
                raise ConfigError(f"{where}: no experiment '{name}'")


@dataclass(frozen=True)
class Ordering:
    """A method has the least value of all, line by line."""

    table: str
    method: str
    quantity: str
    best: str
    among: list[str]
    groups: list[str] = field(default_factory=list)
    where: dict[str, Any] = field(default_factory=dict)
    highest: bool = False  # or the greatest
    count: str = ""  # column: runs or scenes that a value is of; fewer than a verdict takes decide nothing


@dataclass(frozen=True)
class Paired:
    """A method has smaller errors than others, by intervals over pairs."""

    table: str
    method: str
    quantity: str
    best: str
    among: list[str]
    pairs: list[str]
    clusters: list[str]
    groups: list[str] = field(default_factory=list)
    where: dict[str, Any] = field(default_factory=dict)
    near_duplicates_of: str = ""  # table whose near-duplicates are one cluster


@dataclass(frozen=True)
class Interval:
    """An interval that a table has lies on one side of a number."""

    table: str
    estimate: str  # columns
    low: str
    high: str
    counts: list[str]  # columns: how many pairs and runs it is of; each has to be as many as a verdict takes
    groups: list[str] = field(default_factory=list)
    where: dict[str, Any] = field(default_factory=dict)
    above: float | None = None
    below: float | None = None


@dataclass(frozen=True)
class Value:
    """Values are within limits."""

    table: str
    quantity: str
    groups: list[str] = field(default_factory=list)
    where: dict[str, Any] = field(default_factory=dict)
    at_least: float | None = None
    at_most: float | None = None


Check = Union[Ordering, Paired, Interval, Value]
CHECKS = {"ordering": Ordering, "paired": Paired, "interval": Interval, "value": Value}


def _build_check(node: Any, where: str) -> Check:
    """Makes the check that a YAML map's `kind` says."""
    values = dict(build(dict[str, Any], node, where))
    kind = build(str, values.pop("kind", None), f"{where}.kind")
    if kind not in CHECKS:
        raise ConfigError(f"{where}: kind is '{kind}'; known: {', '.join(CHECKS)}")
    return build(CHECKS[kind], values, where)


@dataclass
class Claim:
    """A statement, and what would show it."""

    id: str
    place: str  # in the paper, or where our text has it
    says: str
    checks: list[Annotated[Check, _build_check]]  # on measured tables
    published: list[Annotated[Check, _build_check]] = field(default_factory=list)  # on the paper's own rows
    allows: str = ""  # what these can and cannot show
    note: str = ""


@dataclass
class Claims:
    """Statements by chapter of the report."""

    claims: list[Claim]  # the paper's
    slips: list[Claim]  # suspected ones in the paper
    new: list[Claim]  # ours

    def check(self, where: str) -> None:
        names = [claim.id for claim in (*self.claims, *self.slips, *self.new)]
        if twice := {name for name in names if names.count(name) > 1}:
            raise ConfigError(f"{where}: id {sorted(twice)} is there twice")


def load_claims(path: Path = paths.CLAIMS) -> Claims:
    """Reads what is claimed and how it is checked."""
    return build(Claims, read_yaml(path), str(path))
