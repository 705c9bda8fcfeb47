"""The paper's values in paper/published.yaml, and how ours are compared with them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from sgf_paper import paths
from sgf_paper.strict_yaml import ConfigError, build, read_yaml


@dataclass(frozen=True)
class Tolerance:
    """How far a measured value may be from the published one."""

    reason: str
    keys: dict[str, Any] = field(default_factory=dict)  # the values that it is for; empty: all
    pass_pct: float = 0
    near_pct: float = 0
    pass_abs: float = 0
    near_abs: float = 0


@dataclass
class Comparison:
    """When a published table can be compared with ours, and how near is near."""

    experiment: str
    size: int  # scenes or sequences that have to be there
    protocol: str  # what of it is the same
    tolerances: list[Tolerance]  # the first that fits a value counts
    obstacle: str = ""  # why none of its values can be marked
    least_runs: int = 0  # of a sequence that a value is a mean of
    runs_reason: str = ""  # why it takes so many


def published_entry(name: str) -> Any:
    """An entry of the published values."""
    entry = read_yaml(paths.PUBLISHED).get(name)
    if entry is None:
        raise ConfigError(f"{paths.PUBLISHED}: no entry {name}")
    return entry


def load_comparisons() -> dict[str, Comparison]:
    """How published tables are compared, by their entry in the published values."""
    nodes = published_entry("comparison")
    comparisons = build(dict[str, Comparison], nodes, f"{paths.PUBLISHED}: comparison")
    for name in comparisons:
        published_entry(name)
    return comparisons
