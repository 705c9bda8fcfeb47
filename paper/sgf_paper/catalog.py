"""datasets/catalog.yaml as typed objects: where data sets come from, and what an experiment needs of them.

Reading is strict, as that of experiments. Nothing here needs the network or more than PyYAML.
"""

from __future__ import annotations

import itertools
import re
import reprlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Iterator

from sgf_paper import paths
from sgf_paper.strict_yaml import ConfigError, build, read_yaml

CATALOG = paths.PROJECT / "datasets" / "catalog.yaml"
LARGEST_SIZE = 10**15  # bytes
LONGEST_NAME = 200  # bytes; file systems take 255, and names get longer while their files are made
ARCHIVE_NAMES = (".zip", ".tar", ".tar.gz", ".tgz")


@dataclass(frozen=True)
class Archive:
    """A file as its publisher offers it. What is 0 or empty is not known."""

    urls: list[str] = field(default_factory=list)  # addresses of the same bytes, best first; none: by hand
    bytes: int = 0  # exact
    about_bytes: int = 0  # where the exact size is not known
    sha256: str = ""
    md5: str = ""

    @property
    def expected_bytes(self) -> int:
        return self.bytes or self.about_bytes


@dataclass(frozen=True)
class Piece:
    """What a data set takes from an archive."""

    archive: str
    inside: str = ""  # name of an archive in the archive, in any folder, which is unpacked instead
    take: str = ""  # the folder to take, wherever it is; empty: all, without a single folder around it
    to: str = ""  # where that goes in the data set's folder; empty: the folder itself


@dataclass(frozen=True)
class Publisher:
    home: str
    licence: str
    citation: str = ""


@dataclass(frozen=True)
class Source:
    """A data set: where it comes from and the folder that it unpacks to."""

    title: str
    publisher: Publisher
    folder: str  # below the data root
    citation: str = ""
    holds: list[str] = field(default_factory=list)  # files or folders without which it is not complete; none: any
    unpacked_bytes: int = 0  # about
    by_hand: str = ""  # how to get what fetch cannot download
    ways: list[list[Piece]] = field(default_factory=list)  # pieces that make the folder; the first that works counts

    @property
    def archives(self) -> list[str]:
        """Archives of all ways, in order."""
        return [piece.archive for way in self.ways for piece in way]


@dataclass(frozen=True)
class Catalog:
    archives: dict[str, Archive]
    datasets: dict[str, Source]
    groups: dict[str, list[str]]

    def expand(self, names: list[str]) -> list[str]:
        """Names of data sets for those of data sets and groups, each once."""
        if unknown := [name for name in names if name not in {*self.datasets, *self.groups}]:
            known = ", ".join([*self.groups, *self.datasets])
            raise ConfigError(f"unknown data set '{unknown[0]}'; known: {known}")
        lists = [self.groups.get(name, [name]) for name in names]
        return list(dict.fromkeys(name for names in lists for name in names))


def _require_short(name: str, where: str) -> None:
    if any(len(part.encode(errors="replace")) > LONGEST_NAME for part in Path(name).parts):
        raise ConfigError(f"{where}: {reprlib.repr(name)} is longer than {LONGEST_NAME} bytes")


def _require_relative(path: str, where: str) -> None:
    if path.startswith("/") or ".." in Path(path).parts or "\0" in path:
        raise ConfigError(f"{where}: {path!r} leads out of the data folder")
    _require_short(path, where)


def _require_plain(name: str, where: str) -> None:
    if not name or name.startswith(".") or set(name) & {"/", "\0"}:
        raise ConfigError(f"{where}: {name!r} is not a plain file name")
    _require_short(name, where)


def _require_sizes(sizes: list[int], where: str) -> None:
    if not all(0 <= size <= LARGEST_SIZE for size in sizes):
        raise ConfigError(f"{where}: a number of bytes is negative or beyond {LARGEST_SIZE}")


def _check_archive(name: str, archive: Archive, where: str) -> None:
    _require_plain(name, where)
    if not name.endswith(ARCHIVE_NAMES):
        raise ConfigError(f"{where}: the name ends in none of {', '.join(ARCHIVE_NAMES)}")
    _require_sizes([archive.bytes, archive.about_bytes], where)
    for url in archive.urls:
        if not re.match(r"https?://", url):
            raise ConfigError(f"{where}: '{url}' is neither http:// nor https://")
    for kind, digits in (("sha256", 64), ("md5", 32)):
        if not re.fullmatch(rf"|[0-9a-f]{{{digits}}}", getattr(archive, kind)):
            raise ConfigError(f"{where}: {kind} is not {digits} hexadecimal digits in lower case")


def _load_source(label: str, node: Any, publishers: dict[str, Publisher], where: str) -> Source:
    _require_plain(label, where)
    name = build(dict[str, Any], node, where).get("publisher")
    if not isinstance(name, str) or name not in publishers:
        raise ConfigError(f"{where}: publisher is {reprlib.repr(name)}; known: {', '.join(publishers)}")
    source = build(Source, {**node, "publisher": publishers[name]}, where)
    _require_sizes([source.unpacked_bytes], where)
    for path in [source.folder, *source.holds, *(piece.to for way in source.ways for piece in way)]:
        _require_relative(path, where)
    if str(Path(source.folder)).startswith("."):  # the data folder itself, or hidden, as fetch's own are
        raise ConfigError(f"{where}: folder {source.folder!r} is not a plain one below the data folder")
    if not all(source.ways):
        raise ConfigError(f"{where}.ways: one has no pieces")
    if not source.ways and not source.by_hand:
        raise ConfigError(f"{where}: has neither ways nor by_hand")
    return source


def _check_names(catalog: Catalog, path: Path) -> None:
    for name, source in catalog.datasets.items():
        for archive in source.archives:
            if archive not in catalog.archives:
                raise ConfigError(f"{path}: datasets.{name}: no archive '{archive}'")
            if not catalog.archives[archive].urls and not source.by_hand:
                raise ConfigError(f"{path}: datasets.{name}: '{archive}' has no urls, and there is no by_hand")
    places = sorted((Path(source.folder).parts, name) for name, source in catalog.datasets.items())
    for (outer, first), (inner, second) in itertools.pairwise(places):
        if inner[: len(outer)] == outer:
            raise ConfigError(f"{path}: datasets.{second}: its folder is, or lies in, that of '{first}'")
    for group, names in catalog.groups.items():
        if not names:
            raise ConfigError(f"{path}: groups.{group}: names no data set")
        if unknown := set(names) - set(catalog.datasets):
            raise ConfigError(f"{path}: groups.{group}: no data set '{sorted(unknown)[0]}'")
        if group in catalog.datasets:
            raise ConfigError(f"{path}: groups.{group}: a data set has this name")


def load_catalog(path: Path = CATALOG) -> Catalog:
    """Reads the catalogue."""
    node = {"groups": {}, **read_yaml(path)}
    if set(node) != {"archives", "publishers", "datasets", "groups"}:
        found = ", ".join(map(str, node))
        raise ConfigError(f"{path}: expected archives, publishers, datasets and groups, found {found}")
    groups = build(dict[str, list[str]], node["groups"], f"{path}: groups")
    archives = build(dict[str, Archive], node["archives"], f"{path}: archives")
    for name, archive in archives.items():
        _check_archive(name, archive, f"{path}: archives.{name}")
    publishers = build(dict[str, Publisher], node["publishers"], f"{path}: publishers")
    datasets = {
        name: _load_source(name, source, publishers, f"{path}: datasets.{name}")
        for name, source in build(dict[str, Any], node["datasets"], f"{path}: datasets").items()
    }
    catalog = Catalog(archives, datasets, groups)
    _check_names(catalog, path)
    return catalog


def _texts(node: Any) -> Iterator[str]:
    """All texts of a YAML file, keys of maps included."""
    if isinstance(node, dict):
        node = [*node, *node.values()]
    if isinstance(node, list):
        for item in node:
            yield from _texts(item)
    elif isinstance(node, str):
        yield node


def needed_by(experiments: list[str], catalog: Catalog) -> list[str]:
    """Data sets for fetch that experiments, and those that they refer to, name or whose files they name."""
    known = {file.stem for file in paths.EXPERIMENTS.glob("*.yaml")}
    waiting, seen, words = list(experiments), set(), set()
    while waiting:
        name = waiting.pop()
        seen.add(name)
        texts = set(_texts(read_yaml(paths.EXPERIMENTS / f"{name}.yaml")))
        words |= texts
        waiting += texts & known - seen
    return [
        name
        for name, source in catalog.datasets.items()
        if source.ways
        and (name in words or any(f"{word}/".startswith(f"{source.folder}/") for word in words))
    ]
