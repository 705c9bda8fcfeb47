"""The YAML files of paper/experiments and paper/sweeps as typed objects.

Reading is strict: an unknown or a missing key, or a name that leads nowhere, is a ConfigError that
names the file.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Union

from sgf_paper.strict_yaml import ConfigError, build, build_each, read_yaml

PAPER = Path(__file__).resolve().parent.parent
PROJECT = PAPER.parent
EXPERIMENTS = PAPER / "experiments"
SWEEPS = PAPER / "sweeps"
PUBLISHED = PAPER / "published.yaml"
CLAIMS = PAPER / "claims.yaml"
DEVIATIONS = PAPER / "deviations.yaml"
DEVIATIONS_TEXT = PROJECT / "docs" / "deviations.md"
REFERENCE = PROJECT / "results" / "reference"
RECIPES = PROJECT / "datasets" / "synthetic"
STEREO_LAYOUTS = PROJECT / "datasets" / "stereo_layouts.yaml"
FIRST_FRAME_STEP = 7  # between runs of odometry
TUNING_SEED = 1000  # that of a table's run and this make that of a run which options are tuned on


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

    sweep: Sweep  # by its name in the file
    fixed: dict[str, Any]
    fixed_of: dict[str, dict[str, Any]] = field(default_factory=dict)
    tuning: Tuning | None = None
    published: str = ""  # matcher in the table's entry of the published values

    def parameters(self, column: str) -> Parameters:
        """The fixed parameters of a column."""
        return Parameters(**{**self.fixed, **self.fixed_of.get(column, {})})


@dataclass
class Table:
    kind: str
    name: str
    title: str
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


@dataclass
class LightChange:
    """What changes between the images of a pair, and on which columns its effect is measured."""

    kind: str
    name: str
    title: str
    table: str  # has the sweeps and the fixed parameters
    datasets: list[str]
    columns: list[str]
    twins: dict[str, str]  # scenes taken under a change: the same scene without it, or empty
    changes: dict[str, dict[str, Any]]  # made to right images

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
class DisparityFigure:
    kind: str
    name: str
    title: str
    sweeps: list[str]
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


@dataclass(frozen=True)
class SemiDenseRow:
    """A row of panels: the points of a case, seen from where, coloured by what."""

    title: str
    case: str
    view: str  # top or side
    colour: str  # grey or error


@dataclass(frozen=True)
class SemiDenseColumn:
    options: dict[str, Any]
    extra: bool = False  # only a line of the table


@dataclass
class SemiDense:
    """What `sgf_study semi-dense` runs and how its points are drawn."""

    kind: str
    name: str
    title: str
    pair: str  # below the folder of generated data sets
    study: dict[str, Any]
    cases: dict[str, Any]
    rows: list[SemiDenseRow]
    columns: dict[str, SemiDenseColumn]

    @property
    def drawn(self) -> list[str]:
        """Names of the columns that the figure has, in order."""
        return [name for name, column in self.columns.items() if not column.extra]

    @property
    def bad_pct(self) -> float:
        """A depth is bad when off by more, in percent of the truth."""
        return self.study["bad_pct"]


@dataclass(frozen=True)
class Frame:
    """An image that is matched against a changed copy of itself."""

    file: Path
    generated: bool  # there once the pairs are rendered


@dataclass(frozen=True)
class FrameGroup:
    """Images of one origin: downloaded, or views of the rendered pairs."""

    name: str
    title: str
    frames: dict[str, str]  # by label the file below the folder of data, or of generated data
    generated: bool = False
    instead_of: str = ""  # group that this one stands in for

    def files(self, root: Path) -> dict[str, Path]:
        """Files by label. @param root the folder of data, or of generated data."""
        return {label: root / file for label, file in self.frames.items()}


@dataclass(frozen=True)
class SelfMatchColumn:
    metric: str
    samples: dict[str, Any] = field(default_factory=dict)
    pm: dict[str, Any] = field(default_factory=dict)
    extra: bool = False  # not a column of the paper


@dataclass
class SelfMatch:
    """What `sgf_study self-match` runs on each frame and how it is shown."""

    kind: str
    name: str
    title: str
    groups: list[FrameGroup]
    published: str
    published_group: str
    figure_case: str
    figure_columns: list[str]
    matching: dict[str, Any]
    columns: dict[str, SelfMatchColumn]
    cases: dict[str, dict[str, Any]]
    curves: dict[str, list[float]]

    def present(self, data: str) -> list[FrameGroup]:
        """The groups at hand: generated ones always are, downloaded ones where all files exist.

        @param data folder with downloaded data, may be empty.
        """
        found = []
        for group in self.groups:
            files = group.files(Path(data)).values()
            there = group.generated or data and all(file.exists() for file in files)
            if there and group.instead_of not in [other.name for other in found]:
                found.append(group)
        return found

    def frames(self, generated: Path, data: str) -> dict[str, Frame]:
        """All frames at hand by `group_frame`."""
        return {
            f"{group.name}_{label}": Frame(file, group.generated)
            for group in self.present(data)
            for label, file in group.files(generated if group.generated else Path(data)).items()
        }


@dataclass(frozen=True)
class ImageSet:
    """Images that patches are tracked in: left images of data sets, and views of rendered pairs."""

    title: str
    datasets: list[str] = field(default_factory=list)  # all their pairs
    rendered: list[str] = field(default_factory=list)

    def files(self, generated: Path, datasets: dict[str, Dataset]) -> list[Path]:
        """The images, data sets first. @param generated folder of generated data sets."""
        left = [sorted(datasets[name].folder.glob("*/im0.png")) for name in self.datasets]
        return sum(left, []) + [generated / "pairs" / name / "view.png" for name in self.rendered]


@dataclass(frozen=True)
class ConvergenceColumn:
    residual: str
    epsilon: dict[str, Any] = field(default_factory=dict)
    compared: bool = False  # its converged tracks bound the common set


@dataclass
class Convergence:
    """What `sgf_study convergence` runs and how it is shown."""

    kind: str
    name: str
    title: str
    image_sets: list[ImageSet]
    study: dict[str, Any]
    drawn: list[str]
    table_start: dict[str, float]  # by unit
    columns: dict[str, ConvergenceColumn]
    cases: dict[str, dict[str, Any]]

    def images(self, datasets: dict[str, Dataset]) -> ImageSet:
        """The first set whose data sets were found."""
        for images in self.image_sets:
            if set(images.datasets) <= set(datasets):
                return images
        raise ConfigError(f"{self.name}: no image set is at hand")


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
class SequenceExperiment:
    """What is run on sequences."""

    kind: str
    name: str
    title: str
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
        return read_yaml(RECIPES / f"{shown.folder}.yaml")["scene"] if shown.rendered else ""


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
    conditions: dict[str, Any]
    columns: dict[str, Any]

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

    fail_above_pct: float  # ATE RMSE over the length of the path
    published: str
    programs: dict[str, TrackingProgram]
    tuned: bool = False  # options on top of the columns' own: those tuned on the fold without the sequence

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


@dataclass(frozen=True)
class ExternalSystem:
    """How the trajectories of another system are scored."""

    frame: str = "body"  # that its poses are of: body or camera
    align: str = "se3"  # or sim3 where its scale is not known


@dataclass
class JoinedTable:
    """Trajectory tables side by side, with the paper's rows and the trajectories of other systems."""

    kind: str
    name: str
    title: str
    parts: dict[str, TrajectoryTable]  # by what names of their systems begin with; by name in the file
    published: list[str]  # rows of the paper's table that are systems of their own

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


@dataclass(frozen=True)
class TuningBudget:
    """The same for every column and fold."""

    trials: int  # the defaults' included
    runs: int  # of each sequence and condition in a trial
    held_out_runs: int  # the same on the other fold, of the defaults and of what was found
    frames: int  # of a run


@dataclass
class TrackingTuning:
    """What options of a trajectory table's programs are looked for, and on which sequences."""

    kind: str
    name: str
    title: str
    table: TrajectoryTable  # by its name in the file; its columns are taken without options tuned before
    folder: str  # of what is found, below the results
    folds: list[list[str]]  # all sequences of the table; those rendered are tuned on
    conditions: list[str]
    space: dict[str, SearchRange]
    budget: TuningBudget
    seed: int
    columns: list[str] = field(default_factory=list)  # empty: all of the table
    by_name_only: bool = False  # reproduce.sh runs it only if told to
    like: str = ""  # experiment that has the keys left out here

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


@dataclass
class ShiftProfile:
    """What `sgf_study shift-profile` runs."""

    kind: str
    name: str
    title: str
    study: dict[str, Any]


@dataclass
class ContactSheet:
    """Views of the synthetic scenes."""

    kind: str
    name: str
    title: str
    scenes: dict[str, list[str]]  # names of views


@dataclass
class Sequences:
    """Stereo-inertial sequences: recipes of datasets/synthetic."""

    kind: str
    name: str
    title: str
    short: list[str]
    full: list[str]

    def suite(self, full: bool) -> list[str]:
        return self.full if full else self.short

    def recipes(self, full: bool) -> list[Path]:
        return [RECIPES / f"{name}.yaml" for name in self.suite(full)]


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
class Report:
    """What the report shows, and what counts as decided."""

    kind: str
    name: str
    title: str
    datasets: dict[str, str]  # what each is
    verdict_clusters: int  # fewer independent pairs give no verdict
    margin_pct: float  # ratios nearer to 1 are equal
    items: list[ReportItem]
    pairs: list[ReportPairs]


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


@dataclass
class Claim:
    """A statement, and what would show it."""

    id: str
    place: str  # in the paper, or where our text has it
    says: str
    checks: list[Check]  # on measured tables
    published: list[Check] = field(default_factory=list)  # on the paper's own rows
    allows: str = ""  # what these can and cannot show
    note: str = ""


@dataclass
class Claims:
    """Statements by chapter of the report."""

    claims: list[Claim]  # the paper's
    slips: list[Claim]  # suspected ones in the paper
    new: list[Claim]  # ours


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


Experiment = Union[
    ContactSheet, Convergence, Sequences, Table, Density, DirectMap, LightChange, DisparityFigure, Benchmark,
    JoinedTable, MrptMap, Odometry, Report, SemiDense, SelfMatch, ShiftProfile, TrackingTuning, TrajectoryTable,
]


@dataclass(frozen=True)
class Dataset:
    """A data set that was found."""

    name: str
    folder: Path
    scenes: int


def load_sweep(name: str) -> Sweep:
    """Reads paper/sweeps/<name>.yaml."""
    path = SWEEPS / f"{name}.yaml"
    sweep = build(Sweep, read_yaml(path), str(path))
    sweep.grid = build(Grid, sweep.grid, f"{path}: grid")
    sweep.columns = build_each(Column, sweep.columns, f"{path}: columns")
    return sweep


def _build_block(node: dict[str, Any], where: str) -> TableBlock:
    block = build(TableBlock, node, where)
    if block.tuning is not None:
        block.tuning = build(Tuning, block.tuning, f"{where}: tuning")
    build(Parameters, block.fixed, f"{where}: fixed")
    block.sweep = load_sweep(block.sweep)
    for column in block.sweep.columns:
        parameters = block.parameters(column)
        if parameters.window not in block.sweep.grid.windows:
            raise ConfigError(f"{where}: window {parameters.window} is not on the sweep's grid")
        if parameters.uniqueness not in block.sweep.grid.uniqueness:
            raise ConfigError(f"{where}: uniqueness {parameters.uniqueness} is not on the sweep's grid")
    return block


def _build_table(node: dict[str, Any], where: str) -> Table:
    table = build(Table, node, where)
    table.blocks = [_build_block(block, f"{where}: blocks") for block in table.blocks]
    return table


def _build_light_change(node: dict[str, Any], where: str) -> LightChange:
    experiment = build(LightChange, node, where)
    for sweep in load_experiment(experiment.table).sweeps:
        if unknown := set(experiment.columns) - set(sweep.columns):
            raise ConfigError(f"{where}: no column {sorted(unknown)} in sweep {sweep.name}")
    return experiment


def _build_group(node: dict[str, Any], where: str) -> SceneGroup:
    group = build(SceneGroup, node, where)
    scenes = [build(FigureScene, scene, f"{where}: scenes") for scene in group.scenes]
    return SceneGroup(group.dataset, group.title, scenes)


def _build_figure(node: dict[str, Any], where: str) -> DisparityFigure:
    figure = build(DisparityFigure, node, where)
    figure.groups = [_build_group(group, f"{where}: groups") for group in figure.groups]
    for sweep in figure.sweeps:
        if unknown := set(figure.columns) - set(load_sweep(sweep).columns):
            raise ConfigError(f"{where}: no column {sorted(unknown)} in sweep {sweep}")
    return figure


def _build_semi_dense(node: dict[str, Any], where: str) -> SemiDense:
    figure = build(SemiDense, node, where)
    figure.rows = [build(SemiDenseRow, row, f"{where}: rows") for row in figure.rows]
    figure.columns = build_each(SemiDenseColumn, figure.columns, f"{where}: columns")
    for key in ("min_gradient", "min_epipolar_gradient", "bad_pct"):
        if key not in figure.study:
            raise ConfigError(f"{where}: study: key '{key}' is missing")
    for row in figure.rows:
        known = {"case": figure.cases, "view": ("top", "side"), "colour": ("grey", "error")}
        for key, names in known.items():
            if getattr(row, key) not in names:
                raise ConfigError(f"{where}: rows: {key} '{getattr(row, key)}' is unknown")
    return figure


def _build_self_match(node: dict[str, Any], where: str) -> SelfMatch:
    figure = build(SelfMatch, node, where)
    figure.groups = [build(FrameGroup, group, f"{where}: groups") for group in figure.groups]
    figure.columns = build_each(SelfMatchColumn, figure.columns, f"{where}: columns")
    if figure.figure_case not in figure.cases:
        raise ConfigError(f"{where}: figure_case '{figure.figure_case}' is not among the cases")
    if unknown := set(figure.figure_columns) - set(figure.columns):
        raise ConfigError(f"{where}: figure_columns: no column {sorted(unknown)}")
    wanted = {figure.published_group, *(group.instead_of for group in figure.groups)} - {""}
    if unknown := wanted - {group.name for group in figure.groups}:
        raise ConfigError(f"{where}: no group {sorted(unknown)}")
    return figure


def _build_convergence(node: dict[str, Any], where: str) -> Convergence:
    study = build(Convergence, node, where)
    study.image_sets = [build(ImageSet, images, f"{where}: image_sets") for images in study.image_sets]
    if study.image_sets[-1].datasets:
        raise ConfigError(f"{where}: image_sets: the last one must need no data set")
    study.columns = build_each(ConvergenceColumn, study.columns, f"{where}: columns")
    if unknown := set(study.drawn) - set(study.columns):
        raise ConfigError(f"{where}: drawn: no column {sorted(unknown)}")
    return study


def _build_on_sequences(cls: type, node: dict[str, Any], where: str, of: type = TrackedSequence) -> Any:
    """Makes dataclass `cls`, a SequenceExperiment on sequences `of` a class, of a YAML map."""
    experiment = build(cls, node, where)
    experiment.sequences = build_each(of, experiment.sequences, f"{where}: sequences")
    return experiment


def _build_direct_map(node: dict[str, Any], where: str) -> DirectMap:
    figure = _build_on_sequences(DirectMap, node, where)
    figure.points = build(MapPoints, figure.points, f"{where}: points")
    figure.surface = build(OffSurface, figure.surface, f"{where}: surface")
    limits = figure.surface.doubled_m
    if len(limits) != 2 or not 0 <= limits[0] < limits[1]:
        raise ConfigError(f"{where}: surface: doubled_m is {limits}; it has to be two distances, least first")
    if figure.surface.cell_m <= 0 or figure.surface.cell_points < 2:
        raise ConfigError(f"{where}: surface: cells have to have a size and two points or more")
    return figure


def _check_runs(study: RepeatedRuns, where: str) -> None:
    """Checks what all experiments with repeated runs share."""
    for key in ("compared", "baselines"):
        if unknown := set(getattr(study, key)) - set(study.columns):
            raise ConfigError(f"{where}: {key}: no column {sorted(unknown)}")
    for key in ("runs", "first_frames"):
        if getattr(study, key) < 1:
            raise ConfigError(f"{where}: {key} is {getattr(study, key)}; it has to be positive")
    if study.first_frames < study.verdict_runs:
        raise ConfigError(
            f"{where}: first_frames is {study.first_frames}; a verdict takes {study.verdict_runs} runs that begin"
            " at different ones"
        )
    if any(study.change(sequence, study.undisturbed) for sequence in study.sequences):
        raise ConfigError(f"{where}: conditions: the first one must change nothing")


def _build_odometry(node: dict[str, Any], where: str) -> Odometry:
    study = _build_on_sequences(Odometry, node, where)
    _check_runs(study, where)
    return study


def _build_trajectory_table(node: dict[str, Any], where: str) -> TrajectoryTable:
    study = _build_on_sequences(TrajectoryTable, node, where, TableSequence)
    study.programs = build_each(TrackingProgram, study.programs, f"{where}: programs")
    study.columns = build_each(TrackingColumn, study.columns, f"{where}: columns")
    study.conditions = build_each(TrackingCondition, study.conditions, f"{where}: conditions")
    for name, column in study.columns.items():
        if column.program not in study.programs:
            raise ConfigError(f"{where}: columns.{name}: no program '{column.program}'")
    for name, condition in study.conditions.items():
        if unknown := set(condition.changes) - set(study.sequences):
            raise ConfigError(f"{where}: conditions.{name}: no sequence {sorted(unknown)}")
    _check_runs(study, where)
    return study


def _build_joined_table(node: dict[str, Any], where: str) -> JoinedTable:
    joined = build(JoinedTable, node, where)
    joined.parts = {prefix: load_experiment(name) for prefix, name in joined.parts.items()}
    for part in joined.parts.values():
        if part.kind != "trajectory_table":
            raise ConfigError(f"{where}: parts: {part.name} is no trajectory_table")
        for key in ("lost_below_pct", "fail_above_pct", "published"):
            if getattr(part, key) != getattr(joined.rule, key):
                names = f"{part.name} differs from that of {joined.rule.name}"
                raise ConfigError(f"{where}: parts: {key} of {names}")
    if unknown := set(joined.published) - set(load_published_rows(joined.rule)):
        raise ConfigError(f"{where}: published: the paper has no row {sorted(unknown)}")
    return joined


def _load_untuned_table(name: str) -> TrajectoryTable:
    """A trajectory table with its columns' own options alone."""
    path = EXPERIMENTS / f"{name}.yaml"
    return _build_trajectory_table({**read_yaml(path), "tuned": False}, str(path))


def _check_tuning(tuning: TrackingTuning, where: str) -> None:
    table = tuning.table
    if len(tuning.folds) != 2 or sorted(sum(tuning.folds, [])) != sorted(table.sequences):
        raise ConfigError(f"{where}: folds: each sequence of {table.name} has to be in one of two folds")
    if not all(tuning.rendered(fold) for fold in (0, 1)):
        raise ConfigError(f"{where}: folds: each needs a rendered sequence")
    for key, known in (("conditions", table.conditions), ("columns", table.columns)):
        if unknown := set(getattr(tuning, key)) - set(known):
            raise ConfigError(f"{where}: {key}: {table.name} has no {sorted(unknown)}")
    for name, span in tuning.space.items():
        if not span.low < span.high or (span.log and span.low <= 0):
            raise ConfigError(f"{where}: space.{name}: no range from {span.low} to {span.high}")
    for name, count in asdict(tuning.budget).items():
        if count < 1:
            raise ConfigError(f"{where}: budget: {name} is {count}; it has to be positive")


def _build_tuning(node: dict[str, Any], where: str) -> TrackingTuning:
    if "like" in node:
        node = {**read_yaml(EXPERIMENTS / f"{node['like']}.yaml"), "by_name_only": False, **node}
    tuning = build(TrackingTuning, node, where)
    tuning.table = _load_untuned_table(tuning.table)
    tuning.space = build_each(SearchRange, tuning.space, f"{where}: space")
    tuning.budget = build(TuningBudget, tuning.budget, f"{where}: budget")
    _check_tuning(tuning, where)
    tuning.columns = tuning.columns or list(tuning.table.columns)
    return tuning


def _build_list(cls: type, nodes: list[dict[str, Any]], where: str) -> list[Any]:
    """Makes dataclass `cls` of each of some YAML maps."""
    return [build(cls, node, where) for node in nodes]


def _build_report(node: dict[str, Any], where: str) -> Report:
    report = build(Report, node, where)
    for item in report.items:
        item["tables"] = _build_list(ReportTable, item.get("tables", []), f"{where}: {item.get('name')}: tables")
    report.items = _build_list(ReportItem, report.items, f"{where}: items")
    report.pairs = _build_list(ReportPairs, report.pairs, f"{where}: pairs")
    for name in [part.name for part in (*report.items, *report.pairs)]:
        if not (EXPERIMENTS / f"{name}.yaml").exists():
            raise ConfigError(f"{where}: no experiment '{name}'")
    return report


BUILDERS = {
    "benchmark": partial(build, Benchmark),
    "contact_sheet": partial(build, ContactSheet),
    "convergence": _build_convergence,
    "density": partial(build, Density),
    "direct_map": _build_direct_map,
    "disparity_figure": _build_figure,
    "joined_table": _build_joined_table,
    "light_change": _build_light_change,
    "mrpt_map": partial(_build_on_sequences, MrptMap),
    "odometry": _build_odometry,
    "report": _build_report,
    "self_match": _build_self_match,
    "semi_dense": _build_semi_dense,
    "sequences": partial(build, Sequences),
    "shift_profile": partial(build, ShiftProfile),
    "table": _build_table,
    "trajectory_table": _build_trajectory_table,
    "tuning": _build_tuning,
}


def load_experiment(name: str) -> Experiment:
    """Reads paper/experiments/<name>.yaml; its `kind` says what it is."""
    path = EXPERIMENTS / f"{name}.yaml"
    node, where = read_yaml(path), str(path)
    kind = str(node.get("kind"))
    if kind not in BUILDERS:
        raise ConfigError(f"{where}: kind is '{kind}'; known: {', '.join(BUILDERS)}")
    return BUILDERS[kind](node, where)


def load_experiments(kind: str) -> dict[str, Any]:
    """All experiments of one kind by name."""
    every = (load_experiment(path.stem) for path in sorted(EXPERIMENTS.glob("*.yaml")))
    return {experiment.name: experiment for experiment in every if experiment.kind == kind}


def load_tuned(column: str, program: str, sequence: str) -> dict[str, Any]:
    """Options of a column for a sequence: those that were found on the fold that the sequence is not in."""
    path = EXPERIMENTS / "tuned" / f"{column}.yaml"
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


def load_published(table: Table, matcher: str) -> dict[str, dict[str, float]]:
    """The paper's values as {quantity: {column: value}} in the file's units (px, percent).

    @param matcher of the published entry; empty for one that is not in the paper.
    """
    if not matcher:
        return {}
    entry = read_yaml(PUBLISHED).get(table.published)
    if entry is None or matcher not in entry:
        raise ConfigError(f"{PUBLISHED}: no entry {table.published}.{matcher}")
    return {
        quantity: dict(zip(entry["columns"], values)) for quantity, values in entry[matcher].items()
    }


def _published_entry(name: str) -> Any:
    """An entry of the published values."""
    entry = read_yaml(PUBLISHED).get(name)
    if entry is None:
        raise ConfigError(f"{PUBLISHED}: no entry {name}")
    return entry


def load_published_errors(figure: SelfMatch) -> dict[str, list[float]]:
    """The paper's mean errors (px) of Fig. 1 by column, one per frame of the paper."""
    return _published_entry(figure.published)


def load_published_trajectories(table: TrajectoryTable) -> dict[str, dict[str, float]]:
    """The paper's ATE (m) of each of the table's columns, by the paper's name of the sequence.

    Columns that are not in the paper have none. The average `avg` is as printed.
    """
    rows = load_published_rows(table)
    if unknown := {column.published for column in table.columns.values()} - {"", *rows}:
        raise ConfigError(f"{PUBLISHED}: no entry {table.published}.{sorted(unknown)}")
    return {name: rows.get(column.published, {}) for name, column in table.columns.items()}


def load_published_rows(table: TrajectoryTable) -> dict[str, dict[str, float]]:
    """The paper's ATE (m) of all rows of the table, as load_published_trajectories() has them."""
    entry = dict(_published_entry(table.published))
    names = entry.pop("columns")
    return {row: dict(zip(names, values)) for row, values in entry.items()}


def load_comparisons() -> dict[str, Comparison]:
    """How published tables are compared, by their entry in the published values."""
    where = f"{PUBLISHED}: comparison"
    comparisons = build_each(Comparison, _published_entry("comparison"), where)
    for name, comparison in comparisons.items():
        _published_entry(name)
        comparison.tolerances = _build_list(Tolerance, comparison.tolerances, f"{where}.{name}: tolerances")
    return comparisons


def _build_check(node: dict[str, Any], where: str) -> Check:
    kind = node.get("kind")
    if kind not in CHECKS:
        raise ConfigError(f"{where}: kind is '{kind}'; known: {', '.join(CHECKS)}")
    return build(CHECKS[kind], {key: value for key, value in node.items() if key != "kind"}, where)


def _build_claim(node: dict[str, Any], where: str) -> Claim:
    claim = build(Claim, node, where)
    where = f"{where}.{claim.id}"
    claim.checks = [_build_check(check, f"{where}: checks") for check in claim.checks]
    claim.published = [_build_check(check, f"{where}: published") for check in claim.published]
    return claim


def load_claims(path: Path = CLAIMS) -> Claims:
    """Reads what is claimed and how it is checked."""
    claims = build(Claims, read_yaml(path), str(path))
    for chapter in ("claims", "slips", "new"):
        nodes = getattr(claims, chapter)
        setattr(claims, chapter, [_build_claim(node, f"{path}: {chapter}") for node in nodes])
    names = [claim.id for chapter in (claims.claims, claims.slips, claims.new) for claim in chapter]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ConfigError(f"{path}: id {sorted(twice)} is there twice")
    return claims


def load_external_system(folder: Path) -> ExternalSystem:
    """How the trajectories of a folder are scored: as its align.yaml says, if it has one."""
    path = folder / "align.yaml"
    if not path.exists():
        return ExternalSystem()
    system = build(ExternalSystem, read_yaml(path), str(path))
    for key, known in {"frame": ("body", "camera"), "align": ("se3", "sim3")}.items():
        if getattr(system, key) not in known:
            raise ConfigError(f"{path}: {key} is {getattr(system, key)!r}; known: {', '.join(known)}")
    return system


def image_times_ns(sequence: Path) -> list[int]:
    """Times in the list of images of a sequence in EuRoC's layout; none without one."""
    listing = sequence / "mav0" / "cam0" / "data.csv"
    if not listing.exists():
        return []
    lines = listing.read_text().splitlines()
    return [int(line.split(",")[0]) for line in lines if line and not line.startswith("#")]


def dataset_flags(data: str, generated: str) -> list[str]:
    """Flags that tell sgf_eval where data sets are; `data` may be empty."""
    flags = ["--layouts", str(STEREO_LAYOUTS), "--generated", generated]
    return [*flags, "--data", data] if data else flags


def read_datasets(listing: Path) -> dict[str, Dataset]:
    """Reads the lines `name<TAB>folder<TAB>scenes` that `sgf_eval datasets` prints."""
    found = {}
    for line in listing.read_text().splitlines():
        name, folder, scenes = line.split("\t")
        found[name] = Dataset(name, Path(folder), int(scenes))
    return found
