"""The paper's values beside the measured ones, and how near they are where the two can be compared."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import pandas as pd

from sgf_paper import config, paths
from sgf_paper.published_values import Comparison, Tolerance, load_comparisons
from sgf_paper.stereo_config import Table, load_published
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.study_config import SelfMatch, load_published_errors
from sgf_paper.tracking_config import JoinedTable, load_published_rows

PASS, NEAR, FAIL, NO_MARK = "pass", "near", "fail", "–"
KEYS = ["table", "part", "row", "column", "quantity"]
ROW = [
    *KEYS, "published", "measured", "size", "runs", "measured_by", "pass_within", "near_within", "mark", "reason",
    "tolerance",
]  # fmt: skip
AVERAGED = "table_3_euroc_ate_m"
NAN = float("nan")
Tables = Callable[[str], "pd.DataFrame | None"]


@dataclass(frozen=True)
class Value:
    """One of the paper's values, and what was measured in its place."""

    part: str  # matcher and region, or nothing
    row: str
    column: str
    quantity: str
    published: float
    measured: float
    size: int  # scenes, sequences or frames that the measured value is of
    reason: str = ""  # why there is none
    runs: int = 0  # of each sequence, where runs are repeated
    measured_by: str = ""  # the system of Table III that it is of


def _stereo_values(table: Table, lines: pd.DataFrame | None) -> Iterator[Value]:
    """Of Tables I and II; the paper does not say its region, so its values stand beside both."""
    own = None if lines is None else lines[(lines["dataset"] == table.published_dataset) & (lines["scenes"] > 0)]
    regions = ["region not stated"] if own is None or own.empty else list(own["region"].unique())
    for block in table.blocks:
        for quantity, values in load_published(table, block.published).items():
            for cost, published in values.items():
                for region in regions:
                    yield _stereo_value(table, block.sweep.matcher, cost, quantity, region, published, own)


def _stereo_value(
    table: Table, matcher: str, cost: str, quantity: str, region: str, published: float, own: pd.DataFrame | None
) -> Value:
    key = (f"{matcher}, {region}", cost, quantity, quantity, published)
    if own is None:
        return Value(*key, NAN, 0, f"{table.name} was not made")
    wanted = {"matcher": matcher, "cost": cost, "quantity": quantity, "region": region}
    found = own[(own[list(wanted)] == pd.Series(wanted)).all(axis=1)]
    if found.empty:
        return Value(*key, NAN, 0, f"{table.published_dataset} is not at hand")
    return Value(*key, found["measured"].item(), int(found["scenes"].item()))


def _joined_values(joined: JoinedTable, lines: pd.DataFrame | None) -> Iterator[Value]:
    """Of Table III: a row a system, and the average of ours where all its sequences are measured."""
    systems = {column.published: f"{prefix}_{name}" for prefix, part in joined.parts.items()
               for name, column in part.columns.items() if column.published}  # fmt: skip
    labels = {sequence.published: sequence.euroc_name for sequence in joined.sequences if sequence.published}
    for row, values in load_published_rows(joined.rule).items():
        system, measured = _measured_errors(lines, [systems.get(row, row), row])
        of_labels = measured.reindex([labels.get(label) for label in values if label != "avg"])
        of_labels.index = [label for label in values if label != "avg"]
        errors = {**of_labels["measured"], "avg": of_labels["measured"].mean(skipna=False)}
        runs = {**of_labels["runs"], "avg": of_labels["runs"].min()}
        why = f"{joined.name} was not made" if lines is None else _why_no_error(row, systems)
        for label, published in values.items():
            key = ("", row, label, "ate_mean_m", published)
            if errors[label] != errors[label]:
                yield Value(*key, NAN, 0, why)
            else:
                size = len(of_labels) if label == "avg" else 1
                yield Value(*key, errors[label], size, runs=int(runs[label]), measured_by=system)


def _why_no_error(row: str, systems: dict[str, str]) -> str:
    if row in systems:
        return "the sequence is not at hand in full, or no run succeeds"
    return "a program of others: no trajectory of it below results/external"


def _measured_errors(lines: pd.DataFrame | None, systems: list[str]) -> tuple[str, pd.DataFrame]:
    """The first of the systems that has any error on EuRoC's whole sequences; its mean errors and runs by sequence."""
    nothing = "", pd.DataFrame(columns=["measured", "runs"], dtype=float)
    if lines is None:
        return nothing
    own = lines[(lines["dataset"] == "euroc") & (lines["quantity"] == "ate_mean_m")].dropna(subset="measured")
    found = ((system, own[own["system"] == system]) for system in systems)
    every = ((system, errors.set_index("sequence")[["measured", "runs"]]) for system, errors in found if len(errors))
    return next(every, nothing)


def _self_match_values(figure: SelfMatch, lines: pd.DataFrame | None) -> Iterator[Value]:
    """Of Figure 1."""
    group = next(group for group in figure.groups if group.name == figure.published_group)
    why = f"{figure.name} was not made" if lines is None else f"{group.title}: not at hand"
    for cost, values in load_published_errors(figure).items():
        for frame, published in zip(group.frames, values):
            measured = _measured_frame(figure, lines, frame, cost)
            size = int(measured == measured)
            yield Value("", cost, frame, "mean_px", published, measured, size, "" if size else why)


def _measured_frame(figure: SelfMatch, lines: pd.DataFrame | None, frame: str, cost: str) -> float:
    if lines is None:
        return NAN
    own = lines[
        (lines["group"] == figure.published_group) & (lines["frame"].astype(str) == frame) & (lines["cost"] == cost)
        & (lines["case"] == figure.figure_case) & (lines["first_disparity"] == figure.matching["ranges"][0][0])
    ]  # fmt: skip
    return NAN if own.empty else float(own["mean_px"].item())


READERS = {"table": _stereo_values, "joined_table": _joined_values, "self_match": _self_match_values}


def find_tolerance(comparison: Comparison, value: Value, where: str) -> Tolerance:
    """The first that fits a value; a value without one is an error."""
    keys = {"matcher": value.part.split(",")[0], "row": value.row, "column": value.column, "quantity": value.quantity}
    for tolerance in comparison.tolerances:
        if unknown := set(tolerance.keys) - set(keys):
            raise ConfigError(f"{where}: tolerances: unknown key {sorted(unknown)}; known: {', '.join(keys)}")
        if all(keys[key] in (want if isinstance(want, list) else [want]) for key, want in tolerance.keys.items()):
            return tolerance
    raise ConfigError(f"{where}: no tolerance for {value.row} {value.column} {value.quantity}")


def mark(comparison: Comparison, value: Value, tolerance: Tolerance) -> tuple[str, str]:
    """How near a value is, or why it is not judged."""
    if comparison.obstacle:
        return NO_MARK, comparison.obstacle
    if value.measured != value.measured:
        return NO_MARK, value.reason
    if value.size < comparison.size:
        return NO_MARK, f"{value.size} of {comparison.size} have a value"
    if value.runs < comparison.least_runs:
        return NO_MARK, f"{value.runs} run{'' if value.runs == 1 else 's'}; {comparison.runs_reason}"
    off = abs(value.measured - value.published)
    for name in (PASS, NEAR):
        if off <= _allowed(tolerance, name, value.published):
            return name, f"off by {off:.3g}"
    return FAIL, f"off by {off:.3g}"


def _allowed(tolerance: Tolerance, name: str, published: float) -> float:
    share, absolute = getattr(tolerance, f"{name}_pct"), getattr(tolerance, f"{name}_abs")
    return max(share / 100 * abs(published), absolute) + 1e-9


def compare(tables: Tables) -> pd.DataFrame:
    """A line for each value of the paper, with its mark or the reason why there is none."""
    lines: list[dict[str, Any]] = []
    for entry, comparison in load_comparisons().items():
        experiment = config.load_experiment(comparison.experiment)
        for value in READERS[experiment.kind](experiment, tables(experiment.name)):
            tolerance = find_tolerance(comparison, value, f"{paths.PUBLISHED}: comparison.{entry}")
            word, reason = mark(comparison, value, tolerance)
            lines.append({
                "table": experiment.name, "part": value.part, "row": value.row, "column": value.column,
                "quantity": value.quantity, "published": value.published, "measured": value.measured,
                "size": value.size, "runs": value.runs, "measured_by": value.measured_by,
                "pass_within": _allowed(tolerance, PASS, value.published),
                "near_within": _allowed(tolerance, NEAR, value.published), "mark": word, "reason": reason,
                "tolerance": tolerance.reason,
            })  # fmt: skip
    return pd.DataFrame(lines, columns=ROW)


def published_rows(entry: str) -> pd.DataFrame | None:
    """The paper's values of one table as lines: by matcher and cost, by system and sequence, or by cost and frame.

    @param entry of the published values, or `averages`; None for another.
    """
    if entry == "averages":
        return averages()
    comparisons = load_comparisons()
    if entry not in comparisons:
        return None
    experiment = config.load_experiment(comparisons[entry].experiment)
    values = pd.DataFrame([vars(value) for value in READERS[experiment.kind](experiment, None)])
    if experiment.kind == "table":
        values["matcher"] = [part.split(",")[0] for part in values["part"]]
        index = {"row": "cost", "matcher": "matcher"}
        wide = values.pivot(index=list(index), columns="quantity", values="published")
        return wide.reset_index().rename(columns=index)
    names = {"joined_table": ("system", "sequence"), "self_match": ("cost", "frame")}[experiment.kind]
    values[values["quantity"].iloc[0]] = values["published"]
    return values.rename(columns=dict(zip(("row", "column"), names)))


class PublishedRows:
    """What published_rows() gives, read once."""

    def __init__(self) -> None:
        self._read: dict[str, pd.DataFrame | None] = {}

    def __call__(self, entry: str) -> pd.DataFrame | None:
        if entry not in self._read:
            self._read[entry] = published_rows(entry)
        return self._read[entry]


def averages() -> pd.DataFrame:
    """The printed averages of Table III, the means of their rows, and how far these are apart."""
    rows = published_rows(AVERAGED)
    means = rows[rows["sequence"] != "avg"].groupby("system", sort=False)["ate_mean_m"].agg(["mean", "sum", "count"])
    means["printed"] = rows[rows["sequence"] == "avg"].set_index("system")["ate_mean_m"]
    means["mean_of_one_more"] = means["sum"] / (means["count"] + 1)
    means["off_m"] = (means["mean"] - means["printed"]).abs()
    return means.reset_index()[["system", "printed", "mean", "mean_of_one_more", "off_m"]]
