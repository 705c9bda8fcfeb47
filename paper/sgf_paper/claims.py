"""Claims of paper/claims.yaml, checked against the tables that runs have made and against the paper's own rows.

A check gives an outcome for each place where it can be looked at. Outcomes of a claim make its verdict, and so it can
fail: what is not there, too little for a verdict, or level is never taken for a success.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from sgf_paper import pairs
from sgf_paper.pairs import Rule
from sgf_paper.report_config import Check, Claim, Interval, Ordering, Paired, Value

FIRST_LINE = 2  # of a CSV file, after its header
HOLDS, FAILS, OPEN, FEW, MISSING = "holds", "does not hold", "undecided", "too few", "not measured"
REPRODUCED, PARTLY, NOT, UNDECIDED, NOT_MEASURED = "reproduced", "partly", "not", "undecided", "not measured"
THIS_RUN, REFERENCE = "this run", "reference run"


class ClaimError(Exception):
    """A check that asks for what its table cannot have; the text names both."""


@dataclass(frozen=True)
class Outcome:
    """What one check says in one place."""

    where: str
    state: str
    number: str  # why: the values
    table: str
    lines: tuple[int, ...] = ()  # of the table's file that it rests on

    @property
    def lines_text(self) -> str:
        """The lines as ranges."""
        ranges: list[list[int]] = []
        for line in self.lines:
            if ranges and ranges[-1][-1] == line - 1:
                ranges[-1] = [ranges[-1][0], line]
            else:
                ranges.append([line])
        return ", ".join("–".join(map(str, ends)) for ends in ranges)


@dataclass(frozen=True)
class Judged:
    """What the checks of a claim say of one source."""

    verdict: str
    outcomes: list[Outcome]
    reason: str  # where there is no verdict; else empty

    @property
    def count(self) -> str:
        """How many outcomes say what."""
        states = [outcome.state for outcome in self.outcomes]
        known = [state for state in (HOLDS, FAILS, OPEN, FEW, MISSING) if state in states]
        return ", ".join(f"{state}: {states.count(state)}" for state in known)

    @property
    def decisive(self) -> list[Outcome]:
        """The outcomes that the verdict rests on."""
        unwanted = {MISSING} if self.verdict == UNDECIDED else {MISSING, FEW}
        return [outcome for outcome in self.outcomes if outcome.state not in unwanted]


class Tables:
    """CSV files of a folder by name; None for one that is not there."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._read: dict[str, pd.DataFrame | None] = {}

    def __call__(self, name: str) -> pd.DataFrame | None:
        if name not in self._read:
            path = self.folder / f"{name}.csv"
            self._read[name] = pd.read_csv(path) if path.exists() else None
        return self._read[name]


def choose(lines: pd.DataFrame, where: dict[str, Any], table: str) -> pd.DataFrame:
    """The lines that have the wanted values; a list holds several."""
    for column, wanted in where.items():
        require_columns(lines, [column], table)
        lines = lines[lines[column].isin(wanted if isinstance(wanted, list) else [wanted])]
    return lines


def require_columns(lines: pd.DataFrame, columns: Iterable[str], table: str) -> None:
    """Raises an error that names what is not there."""
    if unknown := [column for column in columns if column not in lines.columns]:
        raise ClaimError(f"table {table} has no column {', '.join(unknown)}")


def _numbers_of(check: Check, lines: pd.DataFrame) -> tuple[int, ...]:
    """Where in the table's file the lines are that a check compares."""
    if isinstance(check, (Ordering, Paired)):
        lines = lines[lines[check.method].isin([check.best, *check.among])]
    return tuple(lines.index + FIRST_LINE)


def shown(value: float) -> str:
    return (f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}").replace("inf", "∞")


def _one_each(check: Ordering, where: str, lines: pd.DataFrame) -> pd.Series:
    """The value of each method, which has to be one."""
    if lines[check.method].duplicated().any():
        raise ClaimError(f"table {check.table} has several lines of a method ({where}): groups leave something out")
    return lines.set_index(check.method)[check.quantity]


def _order(check: Ordering, where: str, lines: pd.DataFrame, rule: Rule) -> list[Outcome]:
    values = _one_each(check, where, lines[lines[check.method].isin([check.best, *check.among])])
    others = values.drop(check.best, errors="ignore").dropna()
    if pd.isna(values.get(check.best)) or others.empty:
        return [Outcome(where, MISSING, f"no value of {check.best}, or of any other", check.table)]
    best = values[check.best]
    nearest = others.idxmax() if check.highest else others.idxmin()
    left_out = [name for name in check.among if name not in others.index]
    number = f"{check.best} {shown(best)}, {nearest} {shown(others[nearest])}"
    number += f" (no value: {', '.join(left_out)})" if left_out else ""
    if check.count and lines[check.count].min() < rule.least:
        return [Outcome(where, FEW, f"{number} ({check.count}: {lines[check.count].min()})", check.table)]
    if best == others[nearest]:
        return [Outcome(where, OPEN, f"{number}: level", check.table)]
    ahead = best > others[nearest] if check.highest else best < others[nearest]
    return [Outcome(where, HOLDS if ahead else FAILS, number, check.table)]


def _pair(check: Paired, where: str, lines: pd.DataFrame, rule: Rule) -> list[Outcome]:
    if check.near_duplicates_of:
        lines = pairs.mark_near_duplicates(lines, check.near_duplicates_of)
    keys = [*check.pairs, *check.clusters]
    require_columns(lines, keys, check.table)
    errors = pairs.side_by_side(lines, check.method, check.quantity, keys)
    outcomes = []
    for other in check.among:
        place = f"{where + ', ' if where else ''}{check.best} / {other}"
        wide, unpaired = pairs.pair_up(errors, check.best, other)
        if wide.empty:
            outcomes.append(Outcome(place, MISSING, "no pair", check.table))
            continue
        result = pairs.compare(wide, unpaired, check.clusters, rule)
        state = {"better": HOLDS, "worse": FAILS, "equal": FAILS}.get(result.verdict, OPEN)
        p = pairs.sign_flip_p(wide) if result.enough and result.pairs == result.clusters else float("nan")
        number = f"{result}" + (f", sign-flip p = {p:.2g}" if p == p else "")
        numbers = _numbers_of(replace(check, among=[other]), lines)
        outcomes.append(Outcome(place, state if result.enough else FEW, number, check.table, numbers))
    return outcomes


def _intervals(check: Interval, where: str, lines: pd.DataFrame, rule: Rule) -> list[Outcome]:
    if len(lines) != 1:
        raise ClaimError(f"table {check.table} has {len(lines)} lines ({where}) where an interval is one")
    line = lines.iloc[0]
    low, high = line[check.low], line[check.high]
    counts = {name: int(line[name]) for name in check.counts}
    number = f"{shown(line[check.estimate])} [{shown(low)}, {shown(high)}]"
    number += "".join(f", {name}: {count}" for name, count in counts.items())
    if pd.isna(low):
        return [Outcome(where, MISSING, "no pair that does not fail twice", check.table)]
    if check.above is not None:
        state = HOLDS if low > check.above else FAILS if high <= check.above else OPEN
    else:
        state = HOLDS if high < check.below else FAILS if low >= check.below else OPEN
    return [Outcome(where, state if min(counts.values()) >= rule.least else FEW, number, check.table)]


def _limits(check: Value, where: str, lines: pd.DataFrame, rule: Rule) -> list[Outcome]:
    values = lines[check.quantity].dropna()
    if values.empty:
        return [Outcome(where, MISSING, "no value", check.table)]
    inside = pd.Series(True, index=values.index)
    if check.at_least is not None:
        inside &= values >= check.at_least
    if check.at_most is not None:
        inside &= values <= check.at_most
    low, high = shown(values.min()), shown(values.max())
    number = f"{check.quantity} {low}" + (f" to {high}" if low != high else "")
    return [Outcome(where, HOLDS if inside.all() else FAILS, number, check.table)]


JUDGES: dict[type, Callable[[Any, str, pd.DataFrame, Rule], list[Outcome]]] = {
    Ordering: _order, Paired: _pair, Interval: _intervals, Value: _limits,
}  # fmt: skip


def _columns_of(check: Check) -> list[str]:
    """Columns that a check reads of its table."""
    names = ("method", "quantity", "estimate", "low", "high", "count")
    return [*check.groups, *getattr(check, "counts", []), *filter(None, (getattr(check, name, "") for name in names))]


def judge_check(check: Check, tables: Callable[[str], pd.DataFrame | None], rule: Rule) -> list[Outcome]:
    """What a check says in each place of its table."""
    lines = tables(check.table)
    if lines is None:
        return [Outcome("", MISSING, f"table {check.table} was not made", check.table)]
    require_columns(lines, _columns_of(check), check.table)
    lines = choose(lines, check.where, check.table)
    if lines.empty:
        return [Outcome("", MISSING, f"table {check.table} has no such line: {_where_text(check.where)}", check.table)]
    judge = JUDGES[type(check)]
    return [
        outcome if outcome.lines else replace(outcome, lines=_numbers_of(check, own))
        for where, own in pairs.group(lines, check.groups)
        for outcome in judge(check, where, own, rule)
    ]


def _where_text(where: dict[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in where.items()) or "it is empty"


def make_verdict(outcomes: list[Outcome]) -> str:
    """Outcomes of too few pairs count only where there are no others; nothing that is not there counts."""
    states = {outcome.state for outcome in outcomes} - {MISSING}
    if not states:
        return NOT_MEASURED
    decided = states - {FEW}
    if not decided or decided == {OPEN}:
        return UNDECIDED
    if decided == {HOLDS}:
        return REPRODUCED
    return PARTLY if HOLDS in decided else NOT


def judge_checks(checks: list[Check], tables: Callable[[str], pd.DataFrame | None], rule: Rule) -> Judged:
    """The verdict of some checks on one source."""
    outcomes = [outcome for check in checks for outcome in judge_check(check, tables, rule)]
    verdict = make_verdict(outcomes)
    reason = ""
    if verdict == NOT_MEASURED:
        reason = "; ".join(dict.fromkeys(outcome.number for outcome in outcomes)) or "nothing can be measured"
    elif verdict == UNDECIDED and {outcome.state for outcome in outcomes} <= {FEW, MISSING}:
        reason = f"fewer than {rule.least} independent pairs"
    elif verdict == UNDECIDED:
        reason = "the intervals hold both answers, or values are level"
    return Judged(verdict, outcomes, reason)


@dataclass(frozen=True)
class Finding:
    """A claim with what is known of it."""

    claim: Claim
    published: Judged | None  # what the paper's rows allow; None where it has none
    sources: dict[str, Judged]  # by name

    @property
    def decided_by(self) -> str:
        """The source with the most outcomes that decide something, the first of those."""

        def weight(name: str) -> tuple[int, int]:
            states = [outcome.state for outcome in self.sources[name].outcomes]
            return sum(state not in (FEW, MISSING) for state in states), states.count(FEW)

        return max(self.sources, key=weight)

    @property
    def by(self) -> str:
        """What the verdict is of."""
        if self.claim.checks:
            return self.decided_by
        return "the published rows" if self.published else "argument"

    @property
    def judged(self) -> Judged:
        """The verdict: of the published rows where nothing has to be measured."""
        return self.sources[self.decided_by] if self.claim.checks or not self.published else self.published


def judge(
    claim: Claim,
    sources: dict[str, Callable[[str], pd.DataFrame | None]],
    published: Callable[[str], pd.DataFrame | None],
    rule: Rule,
) -> Finding:
    """Checks a claim on all sources and on the paper's rows."""
    own = judge_checks(claim.published, published, rule) if claim.published else None
    return Finding(claim, own, {name: judge_checks(claim.checks, tables, rule) for name, tables in sources.items()})
