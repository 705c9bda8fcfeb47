"""Where rows of tables deviate from the paper: paper/deviations.yaml names, by their anchors, entries of
docs/deviations.md, to which tables and report link."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from sgf_paper import paths
from sgf_paper.strict_yaml import ConfigError, read_yaml

ALL = "all"
ROW = re.compile(r'^\| <a id="([a-z0-9-]+)"></a>(.*) \|$')


@dataclass(frozen=True)
class Entry:
    """A line of docs/deviations.md."""

    key: str
    choice: str
    paper: str
    here: str
    why: str


@dataclass(frozen=True)
class Chapter:
    title: str
    entries: list[Entry]


def read_chapters(document: Path = paths.DEVIATIONS_TEXT) -> list[Chapter]:
    """The tables of the document.

    Raises ConfigError for a line without an anchor or with other than four cells, and for an anchor that is there
    twice.
    """
    chapters: list[Chapter] = []
    keys: set[str] = set()
    for number, line in enumerate(document.read_text().splitlines(), 1):
        if line.startswith("## "):
            chapters.append(Chapter(line[3:], []))
        if not line.startswith("| ") or line.endswith("| why |"):
            continue
        row = ROW.match(line)
        cells = [cell.strip() for cell in f"{row[2]} ".split(" | ")] if row else []
        if len(cells) != 4 or row[1] in keys:
            raise ConfigError(f"{document}:{number}: expected an anchor that is new and four cells")
        keys.add(row[1])
        chapters[-1].entries.append(Entry(row[1], *cells))
    return [chapter for chapter in chapters if chapter.entries]


def load_deviations(file: Path = paths.DEVIATIONS, document: Path = paths.DEVIATIONS_TEXT) -> Notes:
    """What rows refer to. Raises ConfigError for a key that is no entry's."""
    groups = read_yaml(file)
    entries = [entry for chapter in read_chapters(document) for entry in chapter.entries]
    numbers = {entry.key: number for number, entry in enumerate(entries, 1)}
    for group, rows in groups.items():
        for row, keys in rows.items():
            if unknown := [key for key in keys if key not in numbers]:
                raise ConfigError(f"{file}: {group}.{row}: {document} has no entry '{unknown[0]}'")
    return Notes(groups, numbers)


@dataclass
class Notes:
    """The entries that rows refer to, by number and key, and which of them a document has referred to."""

    groups: dict[str, dict[str, list[str]]]
    numbers: dict[str, int]
    used: set[str] = field(default_factory=set)

    def __call__(self, group: str, row: str = ALL) -> list[tuple[int, str]]:
        """Of a row, or of a table or figure as a whole."""
        keys = self.groups.get(group, {}).get(row, [])
        self.used.update(keys)
        return sorted((self.numbers[key], key) for key in keys)

    @property
    def legend(self) -> list[tuple[int, str]]:
        """What has been referred to so far."""
        return sorted((self.numbers[key], key) for key in self.used)
