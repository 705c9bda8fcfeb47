"""Downloads, checks and unpacks the data sets of datasets/catalog.yaml, and says what is to be fetched by hand.

Run it again after a failure or a kill: it goes on from what has arrived, and leaves alone what is complete. Never
asks anything. Exit code 0: all named data sets are there; 1: one is not, and why was said; 2: wrong usage.
"""

from __future__ import annotations

import argparse
import hashlib
import shutil
import sys
from dataclasses import dataclass, field
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from sgf_paper import catalog as catalogs
from sgf_paper import config, download, file_lock, unpack
from sgf_paper.catalog import Archive, Catalog, Piece, Source
from sgf_paper.download import DownloadError, Patience
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.unpack import UnpackError

LOCK_WAIT_S = 5  # aria2 notices within a second that who started it was killed


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


@dataclass
class Fetcher:
    """Fetches data sets into a folder, which has to be taken first (see take())."""

    catalog: Catalog
    into: Path
    patience: Patience
    lock: int = -1  # the open file that holds the folder, once it is taken
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

    def is_there(self, name: str) -> bool:
        return unpack.is_complete(self.folder(name), self.catalog.datasets[name].holds)

    def file(self, archive: str) -> Path:
        """Where an archive is: one that the user put into the folder, or the place of a downloaded one."""
        own = self.into / archive
        return own if own.is_file() else self.work / archive

    def is_by_hand(self, name: str) -> bool:
        """Whether a data set has to be fetched by the user, and its archive is not there yet."""
        names = self.catalog.datasets[name].archives
        return not any(self.catalog.archives[a].urls or self.file(a).is_file() for a in names)

    def _missing_bytes(self, archive: str) -> int:
        if self.file(archive).is_file():
            return 0
        part = self.work / f"{archive}.part"
        return max(self.catalog.archives[archive].expected_bytes - download.arrived(part), 0)

    def needed_bytes(self, names: list[str]) -> int:
        """About what fetching data sets the first way takes, archives and what is unpacked together."""
        sources = [self.catalog.datasets[name] for name in names]
        archives = {piece.archive for source in sources for way in source.ways[:1] for piece in way}
        unpacked = sum(source.unpacked_bytes for source in sources)
        inner = max((s.unpacked_bytes for s in sources for w in s.ways[:1] for p in w if p.inside), default=0)
        return sum(map(self._missing_bytes, archives)) + unpacked + inner

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
                raise FetchError(f"{self.file(name)}: {error}") from error

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
        if lacking := [path for path in self.catalog.datasets[name].holds if not (folder / path).exists()]:
            archives = " and ".join(piece.archive for piece in way)
            raise UnpackError(f"{archives}: no {lacking[0]} in what was unpacked")

    def _make_folder(self, name: str, way: list[Piece]) -> None:
        """Makes a data set's folder from the pieces of a way, whole or not at all."""
        archives = dict.fromkeys(piece.archive for piece in way)
        sizes = {archive: self.get_archive(archive).stat().st_size for archive in archives}
        unpacked = self.work / "unpacking" / name
        shutil.rmtree(unpacked.parent, ignore_errors=True)
        unpacked.mkdir(parents=True)
        try:
            self._unpack(name, way, unpacked)
        except unpack.SpaceError:
            raise
        except UnpackError:
            for archive in archives:
                self._forget(archive)
            raise
        for archive, size in sizes.items():
            self.records.add(archive, self.checked[archive], size)
        target = self.folder(name)
        target.parent.mkdir(parents=True, exist_ok=True)
        unpacked.rename(target)

    def make(self, name: str) -> None:
        """@throws FetchError if a data set cannot be had in any way."""
        source = self.catalog.datasets[name]
        if self.folder(name).exists():
            raise FetchError(
                f"{self.folder(name)} is there without all of {', '.join(source.holds)}: move it away, then fetch again"
            )
        reasons = []
        for way in source.ways:
            try:
                self._make_folder(name, way)
                return
            except (FetchError, UnpackError, OSError) as error:
                reasons.append(str(error))
        raise FetchError("; or else: ".join(reasons))

    def clean(self, names: list[str]) -> None:
        """Removes what was left of unpacking, and the archives of complete data sets."""
        shutil.rmtree(self.work / "unpacking", ignore_errors=True)
        wanted = {a for n in names if not self.is_there(n) for a in self.catalog.datasets[n].archives}
        for name in names:
            for archive in set(self.catalog.datasets[name].archives) - wanted:
                (self.work / archive).unlink(missing_ok=True)
                download.drop(self.work / f"{archive}.part")


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
    archives = " and ".join(source.archives)
    place = f"put {archives} into {fetcher.into} and fetch again" if archives else ""
    unpack_line = f"unpack to {fetcher.into / source.folder}"
    return f"by hand: {source.by_hand}; then {place or unpack_line}"


def fetch_one(fetcher: Fetcher, name: str, accepted: bool) -> str:
    """Fetches a data set; what came of it. @throws FetchError if it is not there afterwards."""
    if fetcher.is_there(name):
        return f"at hand: {fetcher.folder(name)}"
    if fetcher.is_by_hand(name):
        raise FetchError(hand_line(fetcher.catalog.datasets[name], fetcher))
    if not accepted:
        raise FetchError("NOT FETCHED: accept its licence, above, with --accept-licences")
    try:
        fetcher.make(name)
    except FetchError as error:
        raise FetchError(f"FAILED: {error}") from error
    return f"done: {fetcher.folder(name)}"


def fetch(fetcher: Fetcher, names: list[str], accepted: bool) -> int:
    """Fetches data sets and ends with a line on each; the exit code."""
    lines, code = {}, 0
    for name in names:
        try:
            lines[name] = fetch_one(fetcher, name, accepted)
        except FetchError as error:
            lines[name], code = str(error), 1
    fetcher.clean(names)
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
    needed, free = fetcher.needed_bytes(names), shutil.disk_usage(fetcher.into).free
    say(f"  needs about {gigabytes(needed)}; {gigabytes(free)} are free in {fetcher.into}")
    if needed > free:
        raise FetchError(f"too little space in {fetcher.into}: {gigabytes(needed)} needed, {gigabytes(free)} free")


def run(catalog: Catalog, names: list[str], into: Path, accepted: bool, patience: Patience) -> int:
    """Shows licences, looks for space and fetches data sets; the exit code. Writes nothing that was not accepted."""
    fetcher = Fetcher(catalog, into, patience)
    absent = [name for name in names if not fetcher.is_there(name)]
    wanted = [name for name in absent if not fetcher.is_by_hand(name)]
    if wanted:
        say("== licences")
        say("\n".join(licence_lines(catalog, wanted)))
    if wanted and accepted:
        say("== fetching")
        fetcher.lock = take(into)
        require_space(fetcher, wanted)
    return fetch(fetcher, names, accepted)


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
    parser.add_argument("--into", type=Path, metavar="DIR", help="folder for all data sets, as --data takes it")
    parser.add_argument("--list", action="store_true", help="list data sets, licences and groups, and stop")
    parser.add_argument("--accept-licences", action="store_true", help="of what is downloaded; without it: nothing")
    parser.add_argument("--jobs", type=int, default=Patience.connections, help="connections per archive")
    parser.add_argument("--catalog", type=Path, default=catalogs.CATALOG, help="another catalogue")
    parser.add_argument("--timeout", type=int, default=Patience.timeout_s, help="s without data until a new attempt")
    parser.add_argument("--attempts", type=int, default=Patience.attempts, help="in a row that bring nothing new")
    parser.add_argument("--pause", type=float, default=Patience.pause_s, help="s after an attempt; doubles")
    parsed = parser.parse_args(arguments)
    if not parsed.list and not (parsed.into and (parsed.names or parsed.experiments)):
        parser.error("needs data sets and --into DIR, or --list")
    for option in ("jobs", "timeout", "attempts"):
        if getattr(parsed, option) < 1:
            parser.error(f"--{option} needs a positive number, not {getattr(parsed, option)}")
    return parsed


def main(arguments: list[str] | None = None) -> int:
    parsed = parse_arguments(arguments)
    try:
        catalog = catalogs.load_catalog(parsed.catalog)
        names = catalog.expand(parsed.names + catalogs.needed_by(parsed.experiments, catalog))
    except ConfigError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2
    if parsed.list:
        list_datasets(catalog, names)
        return 0
    patience = Patience(parsed.jobs, parsed.timeout, parsed.attempts, parsed.pause)
    try:
        return run(catalog, names, parsed.into.resolve(), parsed.accept_licences, patience)
    except (FetchError, ConfigError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("Interrupted; the same command goes on from here.", file=sys.stderr)
        return 130
