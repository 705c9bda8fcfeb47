"""Downloads, checks and unpacks the data sets of datasets/catalog.yaml, and says what is to be fetched by hand.

Run it again after a failure or a kill: it goes on from what has arrived, and leaves alone what is complete. Never
asks anything. An archive is kept as long as a data set of the catalogue that comes from it is not there: the output
says which, to be deleted by who wants no more of it. Exit code 0: all named data sets are there; 1: one is not, and
why was said; 2: wrong usage.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import sys
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any, Iterator

import yaml

from sgf_paper import catalog as catalogs
from sgf_paper import config, download, file_lock, unpack
from sgf_paper.catalog import Archive, Catalog, Piece, Source
from sgf_paper.download import DownloadError, Patience
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.unpack import UnpackError

LOCK_WAIT_S = 5  # aria2 notices within a second that who started it was killed
UNPACKING = ".sgf-unpacking"  # folder beside the data in which they are unpacked
# What the options may be. aria2 takes no more connections to a server, and waits no longer.
LIMITS = {"jobs": (1, 16), "timeout": (1, 600), "attempts": (1, 100), "pause": (0, 3600)}


class FetchError(Exception):
    """Why a data set is not there."""


def gigabytes(count: int) -> str:
    return f"{count / 1e9:.2f} GB"


def say(text: str) -> None:
    print(text, flush=True)


# ---- Checks of archives


def checksums_of(file: Path) -> dict[str, str]:
    """SHA-256 and MD5 of a file, read once."""
    digests = {"sha256": hashlib.sha256(), "md5": hashlib.md5(usedforsecurity=False)}
    with file.open("rb") as stream:
        while block := stream.read(1 << 20):
            for digest in digests.values():
                digest.update(block)
    return {kind: digest.hexdigest() for kind, digest in digests.items()}


class Records:
    """Checksums of the archives that were used first, in a file beside the data."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def read(self) -> dict[str, dict[str, Any]]:
        """@throws ConfigError for a file that holds anything else."""
        records = config.read_yaml(self._file) if self._file.exists() else {}
        for name, record in records.items():
            if not isinstance(record, dict) or not {"sha256", "first_used"} <= set(record):
                raise ConfigError(f"{self._file}: {name} has no sha256 and first_used")
        return records

    def add(self, name: str, sha256: str, size: int) -> None:
        """Records an archive that has none."""
        known = self.read()
        if name in known:
            return
        known[name] = {"sha256": sha256, "bytes": size, "first_used": f"{date.today()}"}
        temporary = self._file.with_name(f"{self._file.name}.new")
        temporary.write_text(yaml.safe_dump(known, sort_keys=False))
        temporary.replace(self._file)

    def check(self, name: str, sha256: str) -> None:
        """@throws FetchError if an archive is not the one that was used first."""
        first = self.read().get(name)
        if first is not None and first["sha256"] != sha256:
            raise FetchError(
                f"{name} has changed: its SHA-256 is {sha256}, that of the first download"
                f" ({first['first_used']}) was {first['sha256']}; to trust this one, remove {name} from {self._file}"
            )


def check(name: str, archive: Archive, file: Path, records: Records) -> str:
    """The SHA-256 of a downloaded archive. @throws FetchError if it is not what it should be."""
    size = file.stat().st_size
    if archive.bytes and size != archive.bytes:
        raise FetchError(f"{name} has {size} bytes, not {archive.bytes}")
    digests = checksums_of(file)
    for kind in ("sha256", "md5"):
        wanted = getattr(archive, kind)
        if wanted and digests[kind] != wanted:
            raise FetchError(f"{name} is another file: its {kind} is {digests[kind]}, not {wanted}")
    if not unpack.is_archive(file):
        raise FetchError(f"{name} is neither a zip nor a tar archive, perhaps a page of the server")
    records.check(name, digests["sha256"])
    return digests["sha256"]


# ---- Fetching


def nearest_folder(path: Path) -> Path:
    """A folder, or the nearest one around it that exists."""
    return next(folder for folder in (path, *path.parents) if folder.is_dir())


@dataclass
class Fetcher:
    """Fetches data sets into a folder, which has to be taken first (see take()), and knows what is in it."""

    catalog: Catalog
    into: Path
    patience: Patience
    lock: int | None = None  # the open file that holds the folder, once it is taken
    checked: dict[str, str] = field(default_factory=dict)  # SHA-256 of archives that are right, by name
    failed: dict[str, str] = field(default_factory=dict)  # why archives cannot be had, by name

    @property
    def work(self) -> Path:
        return self.into / ".sgf-fetch"

    @property
    def records(self) -> Records:
        return Records(self.work / "checksums.yaml")

    def folder(self, name: str) -> Path:
        return self.into / self.catalog.datasets[name].folder

    def lacks(self, name: str) -> str:
        """Something that a data set's folder lacks; empty if it is complete."""
        return unpack.lacks(self.folder(name), self.catalog.datasets[name].holds)

    def is_there(self, name: str) -> bool:
        return not self.lacks(name)

    def file(self, archive: str) -> Path:
        """Where an archive is: one that the user put into the folder, or the place of a downloaded one."""
        own = self.into / archive
        return own if own.is_file() else self.work / archive

    def is_by_hand(self, name: str) -> bool:
        """Whether a data set has to be fetched by the user, and its archive is not there yet."""
        at_hand = {a for a in self.catalog.datasets[name].archives if self.file(a).is_file()}
        ways = [{p.archive for p in way} for way in self.catalog.datasets[name].ways]
        return not any(all(self.catalog.archives[a].urls for a in way - at_hand) for way in ways)

    def _missing_bytes(self, archive: str) -> int:
        if self.file(archive).is_file():
            return 0
        part = self.work / f"{archive}.part"
        return max(self.catalog.archives[archive].expected_bytes - download.arrived(part), 0)

    def needed_bytes(self, names: list[str]) -> dict[Path, int]:
        """About what fetching data sets the first way takes, by a folder on each file system.

        Archives take it here, and what is unpacked where it will lie.
        """
        sources = {name: self.catalog.datasets[name] for name in names}
        first = {name: [piece for way in source.ways[:1] for piece in way] for name, source in sources.items()}
        takes = [(self.folder(name).parent, source.unpacked_bytes) for name, source in sources.items()]
        inner = [take for take, pieces in zip(takes, first.values()) if any(piece.inside for piece in pieces)]
        takes += sorted(inner, key=lambda take: take[1])[-1:]  # one after the other, so only the largest
        takes += [(self.work, self._missing_bytes(a)) for a in {p.archive for pieces in first.values() for p in pieces}]
        folders: dict[int, Path] = {}  # by file system
        needed: Counter[Path] = Counter()
        for place, count in [(self.into, 0), *takes]:
            folder = nearest_folder(place)
            needed[folders.setdefault(folder.stat().st_dev, folder)] += count
        return needed

    def _report(self, name: str, done: int) -> None:
        total = self.catalog.archives[name].expected_bytes
        say(f"  {name}: {gigabytes(done)}" + (f" of {gigabytes(total)}" if total else ""))

    def _check(self, name: str) -> None:
        """Checks a file that is there; a downloaded one that is wrong is removed."""
        file = self.file(name)
        try:
            self.checked[name] = check(name, self.catalog.archives[name], file, self.records)
        except FetchError:
            if file.parent == self.work:
                file.unlink()
            raise

    def _download(self, name: str, url: str) -> None:
        """Downloads an archive from an address and checks it.

        A wrong file of which a part was there before is downloaded once more: the parts may be of two files.
        """
        resumed = download.arrived(self.work / f"{name}.part") > 0
        say(f"  {name}: from {url}")
        download.download(url, self.work / name, self.patience, partial(self._report, name), self.lock)
        try:
            self._check(name)
        except FetchError as error:
            if not resumed:
                raise
            say(f"  {error}; again, from the beginning")
            self._download(name, url)

    def get_archive(self, name: str) -> Path:
        """An archive, checked; downloaded from the first of its addresses that gives it."""
        if name in self.failed:
            raise FetchError(self.failed[name])
        if name not in self.checked and self.file(name).is_file():
            self._check_own(name)
        reasons = []
        for url in self.catalog.archives[name].urls:
            if name in self.checked:
                break
            try:
                self._download(name, url)
            except (DownloadError, FetchError) as error:
                reasons.append(f"{url}: {error}")
                say(f"  {reasons[-1]}")
        if name not in self.checked:
            self.failed[name] = "; ".join(reasons) or f"{name} is not in {self.into}"
            raise FetchError(self.failed[name])
        return self.file(name)

    def _check_own(self, name: str) -> None:
        """Checks an archive that was there before. Of a wrong one that the user put there, nothing else is tried."""
        try:
            self._check(name)
        except FetchError as error:
            if self.file(name).is_file():
                self.failed[name] = f"{self.file(name)}: {error}"
                raise FetchError(self.failed[name]) from error

    def _forget(self, name: str) -> None:
        """Removes a downloaded archive that did not unpack, unless a checksum says that it is the right one."""
        archive = self.catalog.archives[name]
        if not (archive.sha256 or archive.md5 or name in self.records.read()):
            (self.work / name).unlink(missing_ok=True)
            del self.checked[name]

    def _unpack(self, name: str, way: list[Piece], folder: Path) -> None:
        """Unpacks the pieces of a data set. @throws UnpackError if they do not make it."""
        for piece in way:
            say(f"  {name}: unpacking {piece.inside or piece.archive}")
            unpack.unpack(self.file(piece.archive), piece, folder)
        if lacking := unpack.lacks(folder, self.catalog.datasets[name].holds):
            archives = " and ".join(piece.archive for piece in way)
            raise UnpackError(f"{archives}: no {lacking} in what was unpacked")

    @contextmanager
    def _place_to_unpack(self, name: str) -> Iterator[Path]:
        """A new folder on the file system that a data set will lie on: renaming does not lead from one to another."""
        work = nearest_folder(self.folder(name).parent) / UNPACKING
        shutil.rmtree(work, ignore_errors=True)
        try:
            (work / name).mkdir(parents=True)
            yield work / name
        finally:
            shutil.rmtree(work, ignore_errors=True)

    def _get_and_unpack(self, name: str, way: list[Piece], folder: Path) -> None:
        """Has the pieces of a way in a folder."""
        archives = dict.fromkeys(piece.archive for piece in way)
        sizes = {archive: self.get_archive(archive).stat().st_size for archive in archives}
        try:
            self._unpack(name, way, folder)
        except unpack.SpaceError:
            raise
        except UnpackError:
            for archive in archives:
                self._forget(archive)
            raise
        for archive, size in sizes.items():
            self.records.add(archive, self.checked[archive], size)

    def _make_folder(self, name: str, way: list[Piece]) -> None:
        """Makes a data set's folder from the pieces of a way, whole or not at all."""
        with self._place_to_unpack(name) as unpacked:  # first: where nothing can be written, nothing is downloaded
            self._get_and_unpack(name, way, unpacked)
            target = self.folder(name)
            target.parent.mkdir(parents=True, exist_ok=True)
            unpacked.rename(target)

    def _require_place(self, name: str) -> None:
        """@throws FetchError if something else is where a data set's folder, or one around it, has to be."""
        folder = self.folder(name)
        if os.path.lexists(folder):
            raise FetchError(f"{folder} is there without {self.lacks(name)}: move it away, then fetch again")
        for around in folder.parents:
            if os.path.lexists(around) and not around.is_dir():
                raise FetchError(f"{around} is not a folder")

    def make(self, name: str) -> None:
        """@throws FetchError if a data set cannot be had in any way."""
        self._require_place(name)
        reasons = []
        for way in self.catalog.datasets[name].ways:
            try:
                self._make_folder(name, way)
                return
            except unpack.SpaceError as error:  # another way takes space too
                raise FetchError(str(error)) from error
            except (FetchError, UnpackError, OSError) as error:
                reasons.append(str(error))
        raise FetchError("; or else: ".join(dict.fromkeys(reasons)))

    def waiting(self) -> dict[str, list[str]]:
        """The data sets that are not there and could come from an archive, by archive."""
        waiting: dict[str, list[str]] = {}
        for name, source in self.catalog.datasets.items():
            for archive in source.archives:
                names = waiting.setdefault(archive, [])
                if not self.is_there(name):
                    names.append(name)
        return waiting

    def clean(self) -> None:
        """Removes what a kill left of unpacking, and downloaded archives that no data set waits for."""
        for around in {parent for source in self.catalog.datasets.values() for parent in Path(source.folder).parents}:
            shutil.rmtree(self.into / around / UNPACKING, ignore_errors=True)
        for archive, names in self.waiting().items():
            if not names:
                (self.work / archive).unlink(missing_ok=True)
                download.drop(self.work / f"{archive}.part")

    def kept_lines(self) -> list[str]:
        """A line on each downloaded archive, or part of one, that lies in the folder."""
        lines = []
        for archive, names in self.waiting().items():
            for file in (self.work / archive, self.work / f"{archive}.part"):
                if file.exists():
                    lines.append(f"  {file}: {gigabytes(download.arrived(file))}, for {', '.join(names)}")
        return lines


def take(folder: Path) -> int:
    """Takes a folder for this process; the open file that holds it."""
    work = folder / ".sgf-fetch"
    work.mkdir(parents=True, exist_ok=True)
    descriptor = file_lock.take(work / "lock", LOCK_WAIT_S)
    if descriptor is None:
        raise FetchError(f"another fetch is at work in {folder}")
    return descriptor


def hand_line(source: Source, fetcher: Fetcher) -> str:
    """What a user has to do for a data set."""
    archives = " and ".join(a for a in source.archives if not fetcher.catalog.archives[a].urls)
    place = f"put {archives} into {fetcher.into} and fetch again" if archives else ""
    unpack_line = f"unpack to {fetcher.into / source.folder}"
    return f"by hand: {source.by_hand}; then {place or unpack_line}"


def fetch_one(fetcher: Fetcher, name: str) -> str:
    """Fetches a data set into a folder that was taken; what came of it. @throws FetchError if it is not there then."""
    if fetcher.is_there(name):
        return f"at hand: {fetcher.folder(name)}"
    if fetcher.is_by_hand(name):
        raise FetchError(hand_line(fetcher.catalog.datasets[name], fetcher))
    if fetcher.lock is None:
        raise FetchError("NOT FETCHED: accept its licence, above, with --accept-licences")
    try:
        fetcher.make(name)
    except FetchError as error:
        raise FetchError(f"FAILED: {error}") from error
    return f"done: {fetcher.folder(name)}"


def say_kept(fetcher: Fetcher) -> None:
    """Says which archives take space."""
    if lines := fetcher.kept_lines():
        say("== archives kept, not to download them again; delete what you want no more of")
        say("\n".join(lines))


def fetch(fetcher: Fetcher, names: list[str]) -> int:
    """Fetches data sets and ends with a line on each; the exit code. A folder that was not taken is left alone."""
    lines, code = {}, 0
    for name in names:
        try:
            lines[name] = fetch_one(fetcher, name)
        except FetchError as error:
            lines[name], code = str(error), 1
    if fetcher.lock is not None:
        fetcher.clean()
        say_kept(fetcher)
    say("== data sets fetched")
    for name, line in lines.items():
        say(f"  {name:22} {line}")
    return code


# ---- Licences and space, before anything is fetched


def licence_lines(catalog: Catalog, names: list[str]) -> list[str]:
    """Licence and citation of each data set, alike ones together."""
    together: dict[tuple[str, str, str], list[str]] = {}
    for name in names:
        source = catalog.datasets[name]
        key = (source.publisher.licence, source.publisher.home, source.citation or source.publisher.citation)
        together.setdefault(key, []).append(name)
    lines = []
    for (licence, home, citation), alike in together.items():
        lines += [f"  {', '.join(alike)}", f"    licence: {licence}", f"    home: {home}", f"    cite: {citation}"]
    return lines


def require_space(fetcher: Fetcher, names: list[str]) -> None:
    """Says how much space fetching takes, and refuses to begin with less."""
    for folder, needed in fetcher.needed_bytes(names).items():
        free = shutil.disk_usage(folder).free
        say(f"  needs about {gigabytes(needed)}; {gigabytes(free)} are free in {folder}")
        if needed > free:
            say_kept(fetcher)
            raise FetchError(f"too little space in {folder}: {gigabytes(needed)} needed, {gigabytes(free)} free")


def run(catalog: Catalog, names: list[str], into: Path, accepted: bool, patience: Patience) -> int:
    """Shows licences, looks for space and fetches data sets; the exit code. Writes nothing that was not accepted."""
    fetcher = Fetcher(catalog, into, patience)
    wanted = [name for name in names if not (fetcher.is_there(name) or fetcher.is_by_hand(name))]
    if wanted:
        say("== licences")
        say("\n".join(licence_lines(catalog, wanted)))
    if wanted and accepted:
        say("== fetching")
        fetcher.lock = take(into)
        fetcher.clean()
        require_space(fetcher, wanted)
    return fetch(fetcher, names)


# ---- Command line


def size_of(catalog: Catalog, source: Source) -> int:
    """About what is downloaded, the first way."""
    names = {piece.archive for way in source.ways[:1] for piece in way}
    return sum(catalog.archives[name].expected_bytes for name in names)


def list_datasets(catalog: Catalog, names: list[str]) -> None:
    """A line on each data set, below its publisher's licence and home."""
    publisher = None
    for name in names or catalog.datasets:
        source = catalog.datasets[name]
        if source.publisher != publisher:
            publisher = source.publisher
            say(f"{publisher.licence}; {publisher.home}")
        size = size_of(catalog, source)
        how = "by hand" if source.by_hand else gigabytes(size) if size else "size unknown"
        say(f"  {name:22} {how:>12}  {source.title}")
    if not names:
        say("groups")
        for group, members in catalog.groups.items():
            say(f"  {group:22} {len(members):>9} of  {members[0]}, ..., {members[-1]}")


def parse_arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="datasets/fetch", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="data sets or groups of them (see --list)")
    parser.add_argument("--for", nargs="+", dest="experiments", default=[], metavar="EXPERIMENT",
                        help="also those that experiments of the paper use")  # fmt: skip
    parser.add_argument("--into", metavar="DIR", help="folder for all data sets, as --data takes it")
    parser.add_argument("--list", action="store_true", help="list data sets, licences and groups, and stop")
    parser.add_argument("--accept-licences", action="store_true", help="of what is downloaded; without it: nothing")
    parser.add_argument("--jobs", type=int, default=Patience.connections, help="connections per archive, at most 16")
    parser.add_argument("--catalog", type=Path, default=catalogs.CATALOG, help="another catalogue")
    parser.add_argument("--timeout", type=int, default=Patience.timeout_s,
                        help="s without data until a new attempt, at most 600")  # fmt: skip
    parser.add_argument("--attempts", type=int, default=Patience.attempts, help="in a row that bring nothing new")
    parser.add_argument("--pause", type=float, default=Patience.pause_s, help="s after an attempt; doubles")
    parsed = parser.parse_args(arguments)
    if not parsed.list and not (parsed.into and (parsed.names or parsed.experiments)):
        parser.error("needs data sets and --into DIR, or --list")
    if parsed.into and os.path.lexists(parsed.into) and not os.path.isdir(parsed.into):
        parser.error(f"--into needs a folder, which {parsed.into} is not")
    for option, (least, most) in LIMITS.items():
        if not least <= (value := getattr(parsed, option)) <= most:
            parser.error(f"--{option} needs a number from {least} to {most}, not {value}")
    return parsed


def main(arguments: list[str] | None = None) -> int:
    parsed = parse_arguments(arguments)
    try:
        catalog = catalogs.load_catalog(parsed.catalog)
        names = catalog.expand(parsed.names + catalogs.needed_by(parsed.experiments, catalog))
    except ConfigError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2
    patience = Patience(parsed.jobs, parsed.timeout, parsed.attempts, parsed.pause)
    try:
        if parsed.list:
            list_datasets(catalog, names)
            return 0
        return run(catalog, names, Path(parsed.into).absolute(), parsed.accept_licences, patience)
    except (FetchError, ConfigError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("Interrupted; the same command goes on from here.", file=sys.stderr)
        return 130
