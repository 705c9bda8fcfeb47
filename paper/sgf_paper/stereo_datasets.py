"""The stereo data sets that sgf_eval finds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sgf_paper import paths


@dataclass(frozen=True)
class Dataset:
    """A data set that was found."""

    name: str
    folder: Path
    scenes: int


def dataset_flags(data: str, generated: str) -> list[str]:
    """Flags that tell sgf_eval where data sets are; `data` may be empty."""
    flags = ["--layouts", str(paths.STEREO_LAYOUTS), "--generated", generated]
    return [*flags, "--data", data] if data else flags


def read_datasets(listing: Path) -> dict[str, Dataset]:
    """Reads the lines `name<TAB>folder<TAB>scenes` that `sgf_eval datasets` prints."""
    found = {}
    for line in listing.read_text().splitlines():
        name, folder, scenes = line.split("\t")
        found[name] = Dataset(name, Path(folder), int(scenes))
    return found
