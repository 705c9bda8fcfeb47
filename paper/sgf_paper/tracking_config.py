"""Experiments that track a camera through sequences, tables of them, and the tuning of their programs."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar

from sgf_paper import paths
from sgf_paper.experiment import Experiment
from sgf_paper.published_values import published_entry
from sgf_paper.strict_yaml import ConfigError, build, read_yaml

FIRST_FRAME_STEP = 7  # between runs of odometry
TUNING_SEED = 1000  # that of a table's run and this make that of a run which options are tuned on


@dataclass(frozen=True)
class TrackedSequence:
    """A sequence that cameras are tracked in: rendered, or downloaded."""

    folder: str  # below that of the rendered suite, or of downloaded data
    contents: str
    rendered: bool = False
    frames: int = 0  # of a run; 0 for all

    def path(self, suite: Path, data: str) -> Path:
        """Its folder. @param suite folder of the rendered suite."""
        return (suite if self.rendered else Path(data)) / self.folder

    def frames_taken(self, full: bool) -> int:
        """Frames of a run, 0 for all. @param full the full rendered suite, of which runs take all."""
        return 0 if full and self.rendered else self.frames

    def at_hand(self, data: str) -> bool:
        """Whether it can be had: what is rendered always can. @param data may be empty."""
        return self.rendered or (bool(data) and self.path(Path(), data).is_dir())


@dataclass
class SequenceExperiment(Experiment):
    """What is run on sequences."""

    sequences: dict[str, TrackedSequence]

    def present(self, data: str) -> list[str]:
        """Names of the sequences at hand: rendered ones always are.

        @param data folder with downloaded data, may be empty.
        """
        return [name for name, sequence in self.sequences.items() if sequence.at_hand(data)]


@dataclass
class MrptMap(SequenceExperiment):
    """Sequences that go through the MRPT module's programs."""


def _command_line(flags: dict[str, Any]) -> list[str]:
    """Names of options and their values as the programs take them."""
    words = []
    for name, value in flags.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        words += [f"--{name.replace('_', '-')}", text]
    return words


@dataclass(frozen=True)
class MapPoints:
    """Which points of a map are shown and measured."""

    min_support: int  # key-frames that a point was seen in
    max_variance: float  # of its inverse depth, over the square of that


@dataclass(frozen=True)
class OffSurface:
    """How points are measured against the true surface."""

    far_m: float  # off it
    doubled_m: list[float]  # least and largest distance of a second wall's points
    cell_m: float  # side of the cells that a spread is taken in
    cell_points: int  # a cell with fewer has no spread

    def check(self, where: str) -> None:
        limits = self.doubled_m
        if len(limits) != 2 or not 0 <= limits[0] < limits[1]:
            raise ConfigError(f"{where}: doubled_m is {limits}; it has to be two distances, least first")
        if self.cell_m <= 0 or self.cell_points < 2:
            raise ConfigError(f"{where}: cells have to have a size and two points or more")


@dataclass
class DirectMap(SequenceExperiment):
    """What `sgf_direct` runs on which sequences, and how its maps are measured."""

    points: MapPoints
    surface: OffSurface
    change: dict[str, Any]
    columns: dict[str, dict[str, Any]]

    def flags(self, sequence: str, full: bool, column: str) -> list[str]:
        """Flags of `sgf_direct`. @param full the full rendered suite."""
        frames = self.sequences[sequence].frames_taken(full)
        values = {f"change.{key}": value for key, value in self.change.items()}
        return _command_line(values | self.columns[column] | ({"frames": frames} if frames else {}))

    def scene(self, sequence: str) -> str:
        """Scene that a rendered sequence shows; empty for others, whose surface is not known."""
        shown = self.sequences[sequence]
        return read_yaml(paths.RECIPES / f"{shown.folder}.yaml")["scene"] if shown.rendered else ""


@dataclass
class RepeatedRuns(SequenceExperiment, ABC):
    """Programs that track a camera again and again, from other frames on, and how they compare."""

    SCORES_OWN: ClassVar[bool] = False  # runs are scored on their own poses too, not only on common ones

    runs: int  # of each column, unless the command line says otherwise
    first_frames: int  # that runs begin at
    lost_below_pct: float  # frames with a pose
    compared: list[str]
    baselines: list[str]
    verdict_runs: int  # fewer that begin differently give no verdict
    margin_pct: float  # ratios nearer to 1 are equal
    conditions: dict[str, dict[str, Any]]
    columns: dict[str, dict[str, Any]]

    def check(self, where: str) -> None:
        for key in ("compared", "baselines"):
            if unknown := set(getattr(self, key)) - set(self.columns):
                raise ConfigError(f"{where}: {key}: no column {sorted(unknown)}")
        for key in ("runs", "first_frames"):
            if getattr(self, key) < 1:
                raise ConfigError(f"{where}: {key} is {getattr(self, key)}; it has to be positive")
        if self.first_frames < self.verdict_runs:
            raise ConfigError(
                f"{where}: first_frames is {self.first_frames}; a verdict takes {self.verdict_runs} runs that begin"
                " at different ones"
            )
        if not self.conditions or any(self.change(sequence, self.undisturbed) for sequence in self.sequences):
            raise ConfigError(f"{where}: conditions: the first one must change nothing")

    @property
    def undisturbed(self) -> str:
        """The condition that changes nothing: the first."""
        return next(iter(self.conditions))

    @property
    def comparisons(self) -> list[tuple[str, str]]:
        """Columns and what they are compared with."""
        return list(itertools.product(self.compared, self.baselines))

    def conditions_of(self, sequence: str) -> list[str]:
        """The conditions that a sequence is run under."""
        return [condition for condition in self.conditions if self.change(sequence, condition) is not None]

    def first_frame(self, run: int) -> int:
        """Where a run begins: neighbouring runs far apart, all different for as long as that goes."""
        return FIRST_FRAME_STEP * run % self.first_frames

    def flags(
        self, sequence: str, folder: Path, full: bool, run: int, condition: str, column: str
    ) -> list[str]:
        """Flags of a column's program for a run, counted from 0.

        @param folder of the sequence. @param full the full rendered suite.
        """
        frames = self.sequences[sequence].frames_taken(full)
        options = self.options(sequence, folder, condition, column)
        stretch = {"from": self.first_frame(run)} | ({"frames": frames} if frames else {})
        return _command_line(self.change_options(sequence, condition, run + 1) | options | stretch)

    def change_options(self, sequence: str, condition: str, seed: int) -> dict[str, Any]:
        """What a condition does to a sequence's images as options of a program."""
        change = {**(self.change(sequence, condition) or {}), "seed": seed}
        return {f"change.{key}": value for key, value in change.items()}

    @abstractmethod
    def change(self, sequence: str, condition: str) -> dict[str, Any] | None:
        """What a condition does to a sequence's images; None where it is not run."""

    @abstractmethod
    def program(self, column: str) -> str:
        """The program that makes a column."""

    @abstractmethod
    def options(self, sequence: str, folder: Path, condition: str, column: str) -> dict[str, Any]:
        """Options of a column's program but those of the change and of the frames."""

    def score_flags(self, column: str) -> list[str]:
        """Flags of sgf_eval for the column's trajectories."""
        return []


@dataclass
class Odometry(RepeatedRuns):
    """What `sgf_align` runs on which sequences, and what is compared."""

    def change(self, sequence: str, condition: str) -> dict[str, Any]:
        return self.conditions[condition]

    def program(self, column: str) -> str:
        return "sgf_align"

    def options(self, sequence: str, folder: Path, condition: str, column: str) -> dict[str, Any]:
        return {f"alignment.{key}": value for key, value in self.columns[column].items()}


@dataclass(frozen=True)
class TableSequence(TrackedSequence):
    """A sequence of the trajectory table. A cut-out and the whole may have the same folder."""

    least_images: int = 1  # with fewer, or with more than at most, it is not at hand
    most_images: int = 0  # 0: no limit
    published: str = ""  # its column in the published table

    @property
    def dataset(self) -> str:
        if self.rendered:
            return "synthetic"
        return "euroc_slice" if self.most_images else "euroc"

    @property
    def euroc_name(self) -> str:
        """EuRoC's name of it, which a rendered one and a cut share with the original."""
        return Path(self.folder).name

    def at_hand(self, data: str) -> bool:
        if self.rendered or not super().at_hand(data):
            return self.rendered
        images = len(image_times_ns(self.path(Path(), data)))
        return images >= self.least_images and not 0 < self.most_images < images


@dataclass(frozen=True)
class TrackingProgram:
    """A program of the trajectory table: what it takes, and how what it writes is scored."""

    frame: str  # that its poses are of: body or camera
    align: str  # se3, or sim3 where the scale is not known
    photometric: bool = False  # it takes `--photometric FOLDER`


@dataclass(frozen=True)
class TrackingColumn:
    program: str
    options: dict[str, Any] = field(default_factory=dict)
    published: str = ""  # its row in the published table


@dataclass(frozen=True)
class TrackingCondition:
    photometric: bool = False  # rendered sequences come with their photometric calibration
    changes: dict[str, dict[str, Any]] = field(default_factory=dict)  # by sequence; empty: all, unchanged


@dataclass
class TrajectoryTable(RepeatedRuns):
    """What runs on which sequences for the paper's Table III, and what counts as success."""

    SCORES_OWN = True

    sequences: dict[str, TableSequence]
    conditions: dict[str, TrackingCondition]
    columns: dict[str, TrackingColumn]
    fail_above_pct: float  # ATE RMSE over the length of the path
    published: str
    programs: dict[str, TrackingProgram]
    tuned: bool = False  # options on top of the columns' own: those tuned on the fold without the sequence

    def check(self, where: str) -> None:
        for name, column in self.columns.items():
            if column.program not in self.programs:
                raise ConfigError(f"{where}: columns.{name}: no program '{column.program}'")
        for name, condition in self.conditions.items():
            if unknown := set(condition.changes) - set(self.sequences):
                raise ConfigError(f"{where}: conditions.{name}: no sequence {sorted(unknown)}")
        super().check(where)

    def change(self, sequence: str, condition: str) -> dict[str, Any] | None:
        changes = self.conditions[condition].changes
        return changes.get(sequence) if changes else {}

    def program(self, column: str) -> str:
        return self.columns[column].program

    def options(self, sequence: str, folder: Path, condition: str, column: str) -> dict[str, Any]:
        calibrated = self.conditions[condition].photometric and self.sequences[sequence].rendered
        takes_it = self.programs[self.program(column)].photometric
        calibration = {"photometric": folder / "mav0" / "cam0"} if calibrated and takes_it else {}
        tuned = load_tuned(column, self.program(column), sequence) if self.tuned else {}
        return {**self.columns[column].options, **tuned, **calibration}

    def score_flags(self, column: str) -> list[str]:
        program = self.programs[self.program(column)]
        return _command_line({"frame": program.frame, "align": program.align})


def _load_table(name: Any, where: str, **instead: Any) -> TrajectoryTable:
    """Reads the trajectory table of paper/experiments/<name>.yaml. @param instead of what is there."""
    path = paths.EXPERIMENTS / f"{build(str, name, where)}.yaml"
    node = read_yaml(path)
    if node.get("kind") != "trajectory_table":
        raise ConfigError(f"{where}: {name} is no trajectory_table")
    return build(TrajectoryTable, {**node, **instead}, str(path))


@dataclass(frozen=True)
class ExternalSystem:
    """How the trajectories of another system are scored."""

    frame: str = "body"  # that its poses are of: body or camera
    align: str = "se3"  # or sim3 where its scale is not known

    def check(self, where: str) -> None:
        for key, known in {"frame": ("body", "camera"), "align": ("se3", "sim3")}.items():
            if getattr(self, key) not in known:
                raise ConfigError(f"{where}: {key} is {getattr(self, key)!r}; known: {', '.join(known)}")


@dataclass
class JoinedTable(Experiment):
    """Trajectory tables side by side, with the paper's rows and the trajectories of other systems."""

    parts: dict[str, Annotated[TrajectoryTable, _load_table]]  # by what systems' names begin with; by name in the file
    published: list[str]  # rows of the paper's table that are systems of their own

    def check(self, where: str) -> None:
        if not self.parts:
            raise ConfigError(f"{where}: parts: there are none")
        for part in self.parts.values():
            for key in ("lost_below_pct", "fail_above_pct", "published"):
                if getattr(part, key) != getattr(self.rule, key):
                    names = f"{part.name} differs from that of {self.rule.name}"
                    raise ConfigError(f"{where}: parts: {key} of {names}")
        if unknown := set(self.published) - set(load_published_rows(self.rule)):
            raise ConfigError(f"{where}: published: the paper has no row {sorted(unknown)}")

    @property
    def sequences(self) -> list[TableSequence]:
        """Those of all parts, each once."""
        return list(dict.fromkeys(s for part in self.parts.values() for s in part.sequences.values()))

    @property
    def rule(self) -> TrajectoryTable:
        """The part that says what is lost and what has failed: all say the same."""
        return next(iter(self.parts.values()))


@dataclass(frozen=True)
class SearchRange:
    """Where an option's value is looked for."""

    low: float
    high: float
    log: bool = False  # by factors, not by steps
    integer: bool = False

    def check(self, where: str) -> None:
        if not self.low < self.high or (self.log and self.low <= 0):
            raise ConfigError(f"{where}: no range from {self.low} to {self.high}")


@dataclass(frozen=True)
class TuningBudget:
    """The same for every column and fold."""

    trials: int  # the defaults' included
    runs: int  # of each sequence and condition in a trial
    held_out_runs: int  # the same on the other fold, of the defaults and of what was found
    frames: int  # of a run

    def check(self, where: str) -> None:
        for name, count in asdict(self).items():
            if count < 1:
                raise ConfigError(f"{where}: {name} is {count}; it has to be positive")


@dataclass
class TrackingTuning(Experiment):
    """What options of a trajectory table's programs are looked for, and on which sequences."""

    table: Annotated[TrajectoryTable, partial(_load_table, tuned=False)]  # by name in the file; columns' own options
    folder: str  # of what is found, below the results
    folds: list[list[str]]  # all sequences of the table; those rendered are tuned on
    conditions: list[str]
    space: dict[str, SearchRange]
    budget: TuningBudget
    seed: int
    columns: list[str] = field(default_factory=list)  # empty: all of the table
    by_name_only: bool = False  # reproduce.sh runs it only if told to
    like: str = ""  # experiment that has the keys left out here

    def __post_init__(self) -> None:
        self.columns = self.columns or list(self.table.columns)

    def check(self, where: str) -> None:
        table = self.table
        if len(self.folds) != 2 or sorted(sum(self.folds, [])) != sorted(table.sequences):
            raise ConfigError(f"{where}: folds: each sequence of {table.name} has to be in one of two folds")
        if not all(self.rendered(fold) for fold in (0, 1)):
            raise ConfigError(f"{where}: folds: each needs a rendered sequence")
        for key, known in (("conditions", table.conditions), ("columns", table.columns)):
            if unknown := set(getattr(self, key)) - set(known):
                raise ConfigError(f"{where}: {key}: {table.name} has no {sorted(unknown)}")

    @property
    def files(self) -> list[str]:
        """Names of the experiments that this one is made of."""
        return [name for name in (self.name, self.like, self.table.name) if name]

    def rendered(self, fold: int) -> list[str]:
        """The sequences of a fold that are always at hand."""
        return [name for name in self.folds[fold] if self.table.sequences[name].rendered]

    def flags(
        self, sequence: str, folder: Path, condition: str, column: str, run: int, options: dict[str, Any]
    ) -> list[str]:
        """Flags of a column's program for a run, counted from 0.

        It begins where no run of the table does, and sees other exposures.
        """
        table = self.table
        values = table.change_options(sequence, condition, TUNING_SEED + run + 1)
        values |= table.options(sequence, folder, condition, column) | options
        first_frame = table.first_frames + table.first_frame(run)
        return _command_line(values | {"from": first_frame, "frames": self.budget.frames})


def build_tuning(node: dict[str, Any], where: str) -> TrackingTuning:
    """Makes a tuning of a YAML map, with the keys of the one that it is like."""
    if "like" in node:
        node = {**read_yaml(paths.EXPERIMENTS / f"{node['like']}.yaml"), "by_name_only": False, **node}
    return build(TrackingTuning, node, where)


def load_tuned(column: str, program: str, sequence: str) -> dict[str, Any]:
    """Options of a column for a sequence: those that were found on the fold that the sequence is not in."""
    path = paths.EXPERIMENTS / "tuned" / f"{column}.yaml"
    if not path.exists():
        raise ConfigError(
            f"{path}: is missing; `./reproduce.sh --only tune` makes results/tuned/{column}.yaml,"
            " to be looked at and copied"
        )
    node = read_yaml(path)
    if node["program"] != program:
        raise ConfigError(f"{path}: holds options of {node['program']}, not of {program}")
    for fold in node["folds"]:
        if sequence in fold["used_for"] and sequence not in fold["trained_on"]:
            return fold["parameters"]
    raise ConfigError(f"{path}: has no options found without {sequence}")


def load_published_trajectories(table: TrajectoryTable) -> dict[str, dict[str, float]]:
    """The paper's ATE (m) of each of the table's columns, by the paper's name of the sequence.

    Columns that are not in the paper have none. The average `avg` is as printed.
    """
    rows = load_published_rows(table)
    if unknown := {column.published for column in table.columns.values()} - {"", *rows}:
        raise ConfigError(f"{paths.PUBLISHED}: no entry {table.published}.{sorted(unknown)}")
    return {name: rows.get(column.published, {}) for name, column in table.columns.items()}


def load_published_rows(table: TrajectoryTable) -> dict[str, dict[str, float]]:
    """The paper's ATE (m) of all rows of the table, as load_published_trajectories() has them."""
    entry = dict(published_entry(table.published))
    names = entry.pop("columns")
    return {row: dict(zip(names, values)) for row, values in entry.items()}


def load_external_system(folder: Path) -> ExternalSystem:
    """How the trajectories of a folder are scored: as its align.yaml says, if it has one."""
    path = folder / "align.yaml"
    if not path.exists():
        return ExternalSystem()
    return build(ExternalSystem, read_yaml(path), str(path))


def image_times_ns(sequence: Path) -> list[int]:
    """Times in the list of images of a sequence in EuRoC's layout; none without one."""
    listing = sequence / "mav0" / "cam0" / "data.csv"
    if not listing.exists():
        return []
    lines = listing.read_text().splitlines()
    return [int(line.split(",")[0]) for line in lines if line and not line.startswith("#")]
