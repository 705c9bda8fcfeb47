"""Experiments of dense stereo, and the sweeps that they show."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from sgf_paper import paths
from sgf_paper.experiment import Experiment
from sgf_paper.stereo_datasets import Dataset
from sgf_paper.strict_yaml import ConfigError, build, read_yaml


@dataclass(frozen=True)
class Column:
    """One way of matching: a column of the paper's tables."""

    implementation: str  # a method of sgf_stereo
    options: dict[str, Any] = field(default_factory=dict)
    fill: bool = False  # holes of the disparity maps are filled
    extra: bool = False  # not a column of the paper

    @property
    def is_opencv(self) -> bool:
        return self.implementation.startswith("opencv_")


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

    @property
    def sparse_columns(self) -> list[str]:
        """Columns that may leave out pixels: not those whose holes are filled."""
        return [name for name, column in self.columns.items() if not column.fill]

    def column_options(self, name: str) -> dict[str, Any]:
        """Options of a column on top of those that all columns of our matchers share."""
        column = self.columns[name]
        shared = {} if column.is_opencv else self.options
        return {**shared, **column.options}


def load_sweep(name: str) -> Sweep:
    """Reads paper/sweeps/<name>.yaml."""
    path = paths.SWEEPS / f"{name}.yaml"
    return build(Sweep, read_yaml(path), str(path))


def _named_sweep(name: Any, where: str) -> Sweep:
    return load_sweep(build(str, name, where))


@dataclass(frozen=True)
class Parameters:
    window: int  # px
    uniqueness: float  # percent


@dataclass(frozen=True)
class Tuning:
    objective: str
    kept_pct: float


@dataclass
class TableBlock:
    """The columns of one sweep in a table."""

    sweep: Annotated[Sweep, _named_sweep]  # by its name in the file
    fixed: dict[str, Any]
    fixed_of: dict[str, dict[str, Any]] = field(default_factory=dict)
    tuning: Tuning | None = None
    published: str = ""  # matcher in the table's entry of the published values

    def parameters(self, column: str) -> Parameters:
        """The fixed parameters of a column."""
        return Parameters(**{**self.fixed, **self.fixed_of.get(column, {})})

    def check(self, where: str) -> None:
        if unknown := set(self.fixed_of) - set(self.sweep.columns):
            raise ConfigError(f"{where}: fixed_of: no column {sorted(unknown)} in sweep {self.sweep.name}")
        for column in self.sweep.columns:
            values = {**self.fixed, **self.fixed_of.get(column, {})}
            parameters = build(Parameters, values, f"{where}: fixed, of {column}")
            if parameters.window not in self.sweep.grid.windows:
                raise ConfigError(f"{where}: window {parameters.window} is not on the sweep's grid")
            if parameters.uniqueness not in self.sweep.grid.uniqueness:
                raise ConfigError(f"{where}: uniqueness {parameters.uniqueness} is not on the sweep's grid")


@dataclass
class Table(Experiment):
    datasets: list[str]
    published: str
    published_dataset: str
    quantities: list[str]
    blocks: list[TableBlock]
    near_duplicates: list[list[str]] = field(default_factory=list)

    @property
    def sweeps(self) -> list[Sweep]:
        return [block.sweep for block in self.blocks]

    @property
    def curve_blocks(self) -> list[TableBlock]:
        """The blocks of matchers that can be made to keep more or fewer pixels."""
        return [block for block in self.blocks if len(block.sweep.grid.uniqueness) > 1]

    def block(self, sweep: str) -> TableBlock:
        """The block of a sweep."""
        for block in self.blocks:
            if block.sweep.name == sweep:
                return block
        raise ConfigError(f"table {self.name} has no block of sweep {sweep}")

    def has_data(self, datasets: dict[str, Dataset]) -> bool:
        return bool(self.present(datasets))

    def present(self, datasets: dict[str, Dataset]) -> list[str]:
        """Names of the data sets to run among those that were found."""
        return [name for name in self.datasets if name in datasets]

    def absent(self, datasets: dict[str, Dataset]) -> list[str]:
        """Names of the wanted data sets that were not found."""
        return [name for name in self.datasets if name not in datasets]


def load_table(name: str) -> Table:
    """Reads the table of paper/experiments/<name>.yaml."""
    path = paths.EXPERIMENTS / f"{name}.yaml"
    return build(Table, read_yaml(path), str(path))


@dataclass
class Density(Experiment):
    tables: list[str]
    quantities: list[str]
    kept_pct: list[float]

    def has_data(self, datasets: dict[str, Dataset]) -> bool:
        return any(load_table(table).has_data(datasets) for table in self.tables)


@dataclass
class LightChange(Experiment):
    """What changes between the images of a pair, and on which columns its effect is measured."""

    table: str  # has the sweeps and the fixed parameters
    datasets: list[str]
    columns: list[str]
    twins: dict[str, str]  # scenes taken under a change: the same scene without it, or empty
    changes: dict[str, dict[str, Any]]  # made to right images

    def check(self, where: str) -> None:
        for sweep in load_table(self.table).sweeps:
            if unknown := set(self.columns) - set(sweep.columns):
                raise ConfigError(f"{where}: no column {sorted(unknown)} in sweep {sweep.name}")

    def has_data(self, datasets: dict[str, Dataset]) -> bool:
        return bool(self.present(datasets))

    def present(self, datasets: dict[str, Dataset]) -> list[str]:
        """Names of the data sets to run among those that were found."""
        return [name for name in self.datasets if name in datasets]


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
class DisparityFigure(Experiment):
    sweeps: list[str]
    parameters_of: str
    columns: list[str]
    groups: list[SceneGroup]

    def check(self, where: str) -> None:
        for sweep in self.sweeps:
            if unknown := set(self.columns) - set(load_sweep(sweep).columns):
                raise ConfigError(f"{where}: no column {sorted(unknown)} in sweep {sweep}")

    def has_data(self, datasets: dict[str, Dataset]) -> bool:
        return self.group(datasets) is not None

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
class Benchmark(Experiment):
    dataset: str
    scene: str
    repetitions: int
    min_time_s: float  # of one repetition

    def has_data(self, datasets: dict[str, Dataset]) -> bool:
        return self.pair(datasets) is not None

    def pair(self, datasets: dict[str, Dataset]) -> Path | None:
        """Folder of the pair that is matched, None if it is not at hand."""
        if self.dataset not in datasets:
            return None
        folder = datasets[self.dataset].folder / self.scene
        return folder if folder.is_dir() else None


def load_published(table: Table, matcher: str) -> dict[str, dict[str, float]]:
    """The paper's values as {quantity: {column: value}} in the file's units (px, percent).

    @param matcher of the published entry; empty for one that is not in the paper.
    """
    if not matcher:
        return {}
    entry = read_yaml(paths.PUBLISHED).get(table.published)
    if entry is None or matcher not in entry:
        raise ConfigError(f"{paths.PUBLISHED}: no entry {table.published}.{matcher}")
    return {
        quantity: dict(zip(entry["columns"], values)) for quantity, values in entry[matcher].items()
    }
