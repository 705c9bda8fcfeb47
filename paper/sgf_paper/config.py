"""The YAML files of paper/experiments and paper/sweeps as typed objects.

Reading is strict: an unknown or a missing key, or a name that leads nowhere, is a ConfigError that
names the file.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, Union

import yaml

PAPER = Path(__file__).resolve().parent.parent
PROJECT = PAPER.parent
EXPERIMENTS = PAPER / "experiments"
SWEEPS = PAPER / "sweeps"
PUBLISHED = PAPER / "published.yaml"
CATALOGUE = PROJECT / "datasets" / "catalogue.yaml"


class ConfigError(Exception):
    """What is wrong in a file of settings; the text names file and key."""


def _build(cls: type, node: Any, where: str) -> Any:
    """Makes dataclass `cls` of a YAML map whose keys must be exactly its fields."""
    if not isinstance(node, dict):
        raise ConfigError(f"{where}: expected a map, found {node!r}")
    known = {f.name: f for f in fields(cls)}
    for key in node:
        if key not in known:
            raise ConfigError(f"{where}: unknown key '{key}'; known: {', '.join(known)}")
    for name, f in known.items():
        if name not in node and f.default is MISSING and f.default_factory is MISSING:
            raise ConfigError(f"{where}: key '{name}' is missing")
    return cls(**node)


@dataclass(frozen=True)
class Column:
    """One way of matching: a column of the paper's tables."""

    implementation: str  # block_matcher or opencv_bm
    options: dict[str, Any] = field(default_factory=dict)
    extra: bool = False  # not a column of the paper


@dataclass(frozen=True)
class Grid:
    windows: list[int]  # px
    uniqueness: list[float]  # percent


@dataclass
class Sweep:
    """What `sgf_eval stereo` runs: columns over a grid of parameters."""

    name: str
    matcher: str
    num_disparities: dict[str, int]
    columns: dict[str, Column]
    grid: Grid
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def main_columns(self) -> list[str]:
        """The paper's own columns, in order."""
        return [name for name, column in self.columns.items() if not column.extra]

    def column_options(self, name: str) -> dict[str, Any]:
        """Options of a column of our matcher on top of those that all share."""
        column = self.columns[name]
        shared = self.options if column.implementation == "block_matcher" else {}
        return {**shared, **column.options}


@dataclass(frozen=True)
class Parameters:
    window: int  # px
    uniqueness: float  # percent


@dataclass
class Tuning:
    objective: str
    kept_pct: float
    near_duplicates: list[list[str]] = field(default_factory=list)


@dataclass
class Table:
    kind: str
    name: str
    title: str
    sweep: str
    datasets: list[str]
    published: str
    published_dataset: str
    fixed: dict[str, Any]
    quantities: list[str]
    tuning: Tuning
    fixed_of: dict[str, dict[str, Any]] = field(default_factory=dict)

    def parameters(self, column: str) -> Parameters:
        """The fixed parameters of a column."""
        return Parameters(**{**self.fixed, **self.fixed_of.get(column, {})})

    def present(self, datasets: dict[str, Dataset]) -> list[str]:
        """Names of the data sets to run among those that were found."""
        return [name for name in self.datasets if name in datasets]

    def absent(self, datasets: dict[str, Dataset]) -> list[str]:
        """Names of the wanted data sets that were not found."""
        return [name for name in self.datasets if name not in datasets]


@dataclass
class Density:
    kind: str
    name: str
    title: str
    tables: list[str]
    quantities: list[str]
    kept_pct: list[float]


@dataclass(frozen=True)
class FigureScene:
    """Files of one stereo pair, relative to its data set's folder."""

    name: str
    left: str
    right: str
    truth: str
    calibration: str = ""  # read for the number of disparities where that is not given
    num_disparities: int = 0


@dataclass(frozen=True)
class SceneGroup:
    dataset: str
    title: str
    scenes: list[FigureScene]


@dataclass
class DisparityFigure:
    kind: str
    name: str
    title: str
    sweep: str
    parameters_of: str
    columns: list[str]
    groups: list[SceneGroup]

    def group(self, datasets: dict[str, Dataset]) -> SceneGroup | None:
        """First group with a scene whose left image exists, cut down to such scenes."""
        for group in self.groups:
            if group.dataset not in datasets:
                continue
            folder = datasets[group.dataset].folder
            scenes = [scene for scene in group.scenes if (folder / scene.left).exists()]
            if scenes:
                return SceneGroup(group.dataset, group.title, scenes)
        return None


@dataclass
class Benchmark:
    kind: str
    name: str
    title: str
    dataset: str
    scene: str
    repetitions: int
    min_time_s: float  # of one repetition

    def pair(self, datasets: dict[str, Dataset]) -> Path | None:
        """Folder of the pair that is matched, None if it is not at hand."""
        if self.dataset not in datasets:
            return None
        folder = datasets[self.dataset].folder / self.scene
        return folder if folder.is_dir() else None


Experiment = Union[Table, Density, DisparityFigure, Benchmark]


@dataclass(frozen=True)
class Dataset:
    """A data set that was found."""

    name: str
    folder: Path
    scenes: int


def read_yaml(path: Path) -> dict[str, Any]:
    """Reads a YAML file that holds a map."""
    try:
        node = yaml.safe_load(path.read_text())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: {error}") from error
    if not isinstance(node, dict):
        raise ConfigError(f"{path}: expected a map")
    return node


def load_sweep(name: str) -> Sweep:
    """Reads paper/sweeps/<name>.yaml."""
    path = SWEEPS / f"{name}.yaml"
    sweep = _build(Sweep, read_yaml(path), str(path))
    sweep.grid = _build(Grid, sweep.grid, f"{path}: grid")
    sweep.columns = {
        column: _build(Column, node, f"{path}: columns.{column}")
        for column, node in sweep.columns.items()
    }
    return sweep


def _build_table(node: dict[str, Any], where: str) -> Table:
    table = _build(Table, node, where)
    table.tuning = _build(Tuning, table.tuning, f"{where}: tuning")
    _build(Parameters, table.fixed, f"{where}: fixed")
    sweep = load_sweep(table.sweep)
    for column in sweep.columns:
        parameters = table.parameters(column)
        if parameters.window not in sweep.grid.windows:
            raise ConfigError(f"{where}: window {parameters.window} is not on the sweep's grid")
        if parameters.uniqueness not in sweep.grid.uniqueness:
            raise ConfigError(f"{where}: uniqueness {parameters.uniqueness} is not on the sweep's grid")
    return table


def _build_group(node: dict[str, Any], where: str) -> SceneGroup:
    group = _build(SceneGroup, node, where)
    scenes = [_build(FigureScene, scene, f"{where}: scenes") for scene in group.scenes]
    return SceneGroup(group.dataset, group.title, scenes)


def _build_figure(node: dict[str, Any], where: str) -> DisparityFigure:
    figure = _build(DisparityFigure, node, where)
    figure.groups = [_build_group(group, f"{where}: groups") for group in figure.groups]
    unknown = set(figure.columns) - set(load_sweep(figure.sweep).columns)
    if unknown:
        raise ConfigError(f"{where}: no column {sorted(unknown)} in sweep {figure.sweep}")
    return figure


def load_experiment(name: str) -> Experiment:
    """Reads paper/experiments/<name>.yaml; its `kind` says what it is."""
    path = EXPERIMENTS / f"{name}.yaml"
    node, where = read_yaml(path), str(path)
    kind = node.get("kind")
    if kind == "table":
        return _build_table(node, where)
    if kind == "density":
        return _build(Density, node, where)
    if kind == "disparity_figure":
        return _build_figure(node, where)
    if kind == "benchmark":
        return _build(Benchmark, node, where)
    raise ConfigError(f"{where}: kind is '{kind}'; known: table, density, disparity_figure, benchmark")


def load_experiments(kind: str) -> dict[str, Any]:
    """All experiments of one kind by name."""
    every = (load_experiment(path.stem) for path in sorted(EXPERIMENTS.glob("*.yaml")))
    return {experiment.name: experiment for experiment in every if experiment.kind == kind}


def load_published(table: Table, matcher: str) -> dict[str, dict[str, float]]:
    """The paper's values as {quantity: {column: value}} in the file's units (px, percent)."""
    entry = read_yaml(PUBLISHED).get(table.published)
    if entry is None or matcher not in entry:
        raise ConfigError(f"{PUBLISHED}: no entry {table.published}.{matcher}")
    return {
        quantity: dict(zip(entry["columns"], values)) for quantity, values in entry[matcher].items()
    }


def dataset_flags(data: str, generated: str) -> list[str]:
    """Flags that tell sgf_eval where data sets are; `data` may be empty."""
    flags = ["--catalogue", str(CATALOGUE), "--generated", generated]
    return [*flags, "--data", data] if data else flags


def read_datasets(listing: Path) -> dict[str, Dataset]:
    """Reads the lines `name<TAB>folder<TAB>scenes` that `sgf_eval datasets` prints."""
    found = {}
    for line in listing.read_text().splitlines():
        name, folder, scenes = line.split("\t")
        found[name] = Dataset(name, Path(folder), int(scenes))
    return found
