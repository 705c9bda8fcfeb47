"""Unpacks zip and tar archives that nobody vouches for.

All members of an archive are looked at before the first byte is written. One that would land outside the folder,
or is no plain file or folder (a link, a device, a pipe), refuses the whole archive: no data set of the catalogue
has any. Owners and modes are not taken over.

Of what the libraries can read, only what data sets come in is read here: zip with members as they are or deflated,
and tar as it is or in gzip. The other ways to pack ask for gigabytes of memory, or make terabytes of a page.
"""

from __future__ import annotations

import errno
import gzip
import os
import shutil
import stat
import struct
import tarfile
import tempfile
import zipfile
import zlib
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, Iterator

from sgf_paper.catalog import Piece

# What the libraries raise over archives that are damaged, encrypted or packed in unknown ways.
DAMAGE = (
    zipfile.BadZipFile, tarfile.TarError, zlib.error, gzip.BadGzipFile, struct.error, EOFError,
    RuntimeError, NotImplementedError, ValueError, ArithmeticError, LookupError,
)  # fmt: skip
BLOCK = 1 << 16  # bytes read at once
Parts = tuple[str, ...]


class UnpackError(Exception):
    """Why an archive is not unpacked; names archive and member."""


class SpaceError(UnpackError):
    """Too little space is free; the archive may be right."""


@dataclass(frozen=True)
class Member:
    """A file in an archive."""

    name: str  # as the archive has it
    parts: Parts  # of its path, checked
    size: int  # bytes, unpacked


def _checked_parts(archive: Path, name: str) -> Parts:
    path = PurePosixPath(name)
    if path.is_absolute():
        raise UnpackError(f"{archive.name}: '{name}' has an absolute path")
    if ".." in path.parts:
        raise UnpackError(f"{archive.name}: '{name}' leads out of the folder")
    return path.parts or (".",)


def _require_plain(archive: Path, name: str, plain: bool) -> None:
    if not plain:
        raise UnpackError(f"{archive.name}: '{name}' is a link or a device, not a file or folder")


def _zip_members(archive: Path) -> list[Member]:
    members = []
    with zipfile.ZipFile(archive) as opened:
        if sum(info.compress_size for info in opened.infolist()) > archive.stat().st_size:
            raise UnpackError(f"{archive.name}: its members overlap")
        for info in opened.infolist():
            parts = _checked_parts(archive, info.filename)
            kind = stat.S_IFMT(info.external_attr >> 16)  # 0: made where files have no such kinds
            _require_plain(archive, info.filename, kind in (0, stat.S_IFREG, stat.S_IFDIR))
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise UnpackError(f"{archive.name}: '{info.filename}' is neither stored nor deflated")
            if not info.is_dir():
                members.append(Member(info.filename, parts, info.file_size))
    return members


class _Blocks:
    """What tarfile reads from. It believes the sizes that headers state: more at once than a block is refused."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self.tell, self.seek = stream.tell, stream.seek

    def read(self, size: int) -> bytes:
        if not 0 <= size <= BLOCK:
            raise tarfile.ReadError(f"a header of {size} bytes")
        return self._stream.read(size)


@contextmanager
def _open_tar(archive: Path) -> Iterator[tarfile.TarFile]:
    with archive.open("rb") as file:
        open_it = gzip.open if file.read(2) == b"\x1f\x8b" else open
    with open_it(archive, "rb") as stream, tarfile.TarFile(fileobj=_Blocks(stream)) as opened:
        yield opened


def _tar_members(archive: Path) -> list[Member]:
    members = []
    with _open_tar(archive) as opened:
        for info in opened:
            parts = _checked_parts(archive, info.name)
            _require_plain(archive, info.name, (info.isfile() or info.isdir()) and not info.issparse())
            if info.size < 0:
                raise UnpackError(f"{archive.name}: '{info.name}' has a size below 0")
            if info.isfile():
                members.append(Member(info.name, parts, info.size))
    return members


def is_archive(path: Path) -> bool:
    """Whether a file begins as an archive that can be unpacked here."""
    try:
        if zipfile.is_zipfile(path):
            return True
        with _open_tar(path):
            return True
    except DAMAGE:
        return False


@contextmanager
def _as_unpack_errors(archive: Path) -> Iterator[None]:
    try:
        yield
    except DAMAGE as error:
        raise UnpackError(f"{archive.name}: damaged or of an unknown kind: {error}") from error
    except OSError as error:  # such as of a name that is too long
        kind = SpaceError if error.errno == errno.ENOSPC else UnpackError
        raise kind(f"{archive.name}: {error.strerror or error}") from error


def list_members(archive: Path) -> list[Member]:
    """All files of an archive, all of which may be unpacked, but for what macOS adds.

    @throws UnpackError for an archive that cannot be read, or has a member that may not be unpacked.
    """
    if not is_archive(archive):
        with archive.open("rb") as file:
            raise UnpackError(f"{archive.name}: neither zip nor tar; begins with {file.read(16)!r}")
    with _as_unpack_errors(archive):
        members = _zip_members(archive) if zipfile.is_zipfile(archive) else _tar_members(archive)
    return [member for member in members if member.parts[0] != "__MACOSX"]


def _streams(archive: Path, wanted: set[str]) -> Iterator[tuple[str, IO[bytes]]]:
    """Names and contents of members, in the order of the archive, whose end is read too for its checksum."""
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as opened:
            for name in [info.filename for info in opened.infolist() if info.filename in wanted]:
                with opened.open(name) as stream:
                    yield name, stream
        return
    with _open_tar(archive) as opened:
        for info in opened:
            if info.isfile() and info.name in wanted:
                yield info.name, opened.extractfile(info)
        while opened.fileobj.read(BLOCK):
            pass


def _end_of(tail: Parts, parts: Parts) -> int:
    """Where in a path some folders in it first end, 0 if they are not in it."""
    return next((end for end in range(len(tail), len(parts) + 1) if parts[end - len(tail) : end] == tail), 0)


def folder_of(members: list[Member], take: str) -> Parts:
    """Where in an archive the folder `take` is; with no name a single folder around all files, or the top."""
    folders = [member.parts[:-1] for member in members]
    if not take:
        tops = {parts[:1] for parts in folders}
        return tops.pop() if len(tops) == 1 else ()
    tail = PurePosixPath(take).parts
    ends = {parts: _end_of(tail, parts) for parts in folders}
    found = {parts[:end] for parts, end in ends.items() if end}
    least = min((len(parts) for parts in found), default=0)
    nearest = [parts for parts in found if len(parts) == least]
    if len(nearest) != 1:
        raise UnpackError(f"folder '{take}' is there {len(nearest)} times")
    return nearest[0]


def require_space(folder: Path, needed: int, what: str) -> None:
    """@throws SpaceError if the file system of a folder has less free space than is needed."""
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise SpaceError(f"{what} needs {needed / 1e9:.1f} GB; {free / 1e9:.1f} GB are free in {folder}")


def _write(stream: IO[bytes], member: Member, file: Path) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("wb") as out:
        shutil.copyfileobj(stream, out, BLOCK)
    if file.stat().st_size != member.size:
        raise UnpackError(f"'{member.name}' has {file.stat().st_size} bytes, not {member.size} as stated")


def extract(archive: Path, members: list[Member], files: list[Path]) -> None:
    """Writes each member to the file of the same place in the list."""
    if len(set(files)) < len(members):
        raise UnpackError(f"{archive.name}: two members want the same place")
    by_name = {member.name: (member, file) for member, file in zip(members, files)}
    written = set()
    with _as_unpack_errors(archive):
        try:
            for name, stream in _streams(archive, set(by_name)):
                _write(stream, *by_name[name])
                written.add(name)
        except (FileExistsError, NotADirectoryError, IsADirectoryError) as error:
            raise UnpackError(f"{archive.name}: a file and a folder want the same place: {error.filename}") from error
    if missing := set(by_name) - written:
        raise UnpackError(f"{archive.name}: '{sorted(missing)[0]}' could not be read")


def _unpack_inner(archive: Path, piece: Piece, folder: Path) -> None:
    """Unpacks a piece from an archive in the archive, which is first written beside the folder."""
    members = list_members(archive)
    found = [member for member in members if member.parts[-1] == piece.inside]
    if len(found) != 1:
        raise UnpackError(f"{archive.name}: '{piece.inside}' is there {len(found)} times")
    require_space(folder.parent, found[0].size, f"unpacking {piece.inside}")
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix="inner.") as work:
        inner = Path(work) / found[0].parts[-1]
        extract(archive, found, [inner])
        unpack(inner, Piece(archive.name, take=piece.take, to=piece.to), folder)


def unpack(archive: Path, piece: Piece, folder: Path) -> None:
    """Unpacks a piece of a data set into its folder, which may hold other pieces.

    @throws UnpackError as list_members(); if the piece is not in the archive, or there is too little space.
    """
    if piece.inside:
        _unpack_inner(archive, piece, folder)
        return
    members = list_members(archive)
    try:
        root = folder_of(members, piece.take)
    except UnpackError as error:
        raise UnpackError(f"{archive.name}: {error}") from error
    taken = [member for member in members if member.parts[: len(root)] == root]
    require_space(folder.parent, sum(member.size for member in taken), f"unpacking {archive.name}")
    target = folder / piece.to
    extract(archive, taken, [target.joinpath(*member.parts[len(root) :]) for member in taken])


def lacks(folder: Path, holds: list[str]) -> str:
    """The first that a data set's folder lacks of what it has to hold, or of any files; empty if it is complete."""
    if holds:
        return next((name for name in holds if not os.path.exists(folder / name)), "")
    return "" if folder.is_dir() and any(folder.iterdir()) else "files"
