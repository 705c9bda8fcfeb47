"""Experiments of `sgf_study`, and those that show what is rendered."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sgf_paper import paths
from sgf_paper.experiment import Experiment
from sgf_paper.published_values import published_entry
from sgf_paper.stereo_datasets import Dataset
from sgf_paper.strict_yaml import ConfigError


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
class SemiDense(Experiment):
    """What `sgf_study semi-dense` runs and how its points are drawn."""

    pair: str  # below the folder of generated data sets
    study: dict[str, Any]
    cases: dict[str, Any]
    rows: list[SemiDenseRow]
    columns: dict[str, SemiDenseColumn]

    def check(self, where: str) -> None:
        for key in ("min_gradient", "min_epipolar_gradient", "bad_pct"):
            if key not in self.study:
                raise ConfigError(f"{where}: study: key '{key}' is missing")
        for index, row in enumerate(self.rows):
            known = {"case": self.cases, "view": ("top", "side"), "colour": ("grey", "error")}
            for key, names in known.items():
                if getattr(row, key) not in names:
                    raise ConfigError(f"{where}: rows[{index}]: {key} '{getattr(row, key)}' is unknown")

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
class SelfMatch(Experiment):
    """What `sgf_study self-match` runs on each frame and how it is shown."""

    groups: list[FrameGroup]
    published: str
    published_group: str
    figure_case: str
    figure_columns: list[str]
    matching: dict[str, Any]
    columns: dict[str, SelfMatchColumn]
    cases: dict[str, dict[str, Any]]
    curves: dict[str, list[float]]

    def check(self, where: str) -> None:
        if self.figure_case not in self.cases:
            raise ConfigError(f"{where}: figure_case '{self.figure_case}' is not among the cases")
        if unknown := set(self.figure_columns) - set(self.columns):
            raise ConfigError(f"{where}: figure_columns: no column {sorted(unknown)}")
        wanted = {self.published_group, *(group.instead_of for group in self.groups)} - {""}
        if unknown := wanted - {group.name for group in self.groups}:
            raise ConfigError(f"{where}: no group {sorted(unknown)}")

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
class Convergence(Experiment):
    """What `sgf_study convergence` runs and how it is shown."""

    image_sets: list[ImageSet]
    study: dict[str, Any]
    drawn: list[str]
    table_start: dict[str, float]  # by unit
    columns: dict[str, ConvergenceColumn]
    cases: dict[str, dict[str, Any]]

    def check(self, where: str) -> None:
        if not self.image_sets or self.image_sets[-1].datasets:
            raise ConfigError(f"{where}: image_sets: the last one must need no data set")
        if unknown := set(self.drawn) - set(self.columns):
            raise ConfigError(f"{where}: drawn: no column {sorted(unknown)}")

    def images(self, datasets: dict[str, Dataset]) -> ImageSet:
        """The first set whose data sets were found."""
        for images in self.image_sets:
            if set(images.datasets) <= set(datasets):
                return images
        raise ConfigError(f"{self.name}: no image set is at hand")


@dataclass
class ShiftProfile(Experiment):
    """What `sgf_study shift-profile` runs."""

    study: dict[str, Any]


@dataclass
class ContactSheet(Experiment):
    """Views of the synthetic scenes."""

    scenes: dict[str, list[str]]  # names of views


@dataclass
class Sequences(Experiment):
    """Stereo-inertial sequences: recipes of datasets/synthetic."""

    short: list[str]
    full: list[str]

    def suite(self, full: bool) -> list[str]:
        return self.full if full else self.short

    def recipes(self, full: bool) -> list[Path]:
        return [paths.RECIPES / f"{name}.yaml" for name in self.suite(full)]


def load_published_errors(figure: SelfMatch) -> dict[str, list[float]]:
    """The paper's mean errors (px) of Fig. 1 by column, one per frame of the paper."""
    return published_entry(figure.published)
