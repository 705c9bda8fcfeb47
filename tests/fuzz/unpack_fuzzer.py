"""Archives that nobody vouches for: unpacked as the data sets of the catalogue are.

Whatever an archive holds, it is refused with an UnpackError, or its files lie in the folder that was named, and
nowhere else.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

from sgf_paper.catalog import Piece
from sgf_paper.unpack import UnpackError, is_archive, unpack

FOLDER = tempfile.TemporaryDirectory(prefix="sgf_fuzz_")  # removed at the end of the process
WORK = Path(FOLDER.name) / "work"  # all that is written to
PIECES = [Piece("input"), Piece("input", take="a", to="b"), Piece("input", inside="in.zip", take="a")]
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
outside: list[Any] = []  # what was written elsewhere, and links


def watch(event: str, arguments: tuple[Any, ...]) -> None:
    """Notes links and what is opened to be written, or made, outside the folder, as an audit hook."""
    if event in ("os.symlink", "os.link"):
        outside.append((event, *arguments))
    elif event == "os.mkdir" or event == "open" and arguments[2] & WRITING:
        place = Path(os.path.normpath(os.fsdecode(arguments[0])))
        if WORK not in [place, *place.parents]:
            outside.append((event, *arguments))


sys.addaudithook(watch)


def with_right_checksums(data: bytes) -> bytes:
    """A tar archive with the checksums of its headers set right: a changed file would never get past them."""
    blocks = bytearray(data)
    for at in range(0, len(data) - 511, 512):
        if blocks[at + 257 : at + 262] == b"ustar":
            blocks[at + 148 : at + 156] = b"%06o\0 " % tarfile.calc_chksums(bytes(blocks[at : at + 512]))[0]
    return bytes(blocks)


def unpack_into(piece: Piece, file: Path) -> None:
    """Unpacks a piece into a new folder and looks at what has come of it."""
    folder = WORK / "folder"
    folder.mkdir(parents=True)
    outside.clear()
    with contextlib.suppress(UnpackError):
        unpack(file, piece, folder)
    links = [path for path in WORK.rglob("*") if path.is_symlink() or not (path.is_file() or path.is_dir())]
    left = [path for path in WORK.iterdir() if path != folder]
    shutil.rmtree(WORK)
    assert not (links or left or outside), f"links {links}, left {left}, written outside {outside}"


def fuzz(data: bytes) -> None:
    """Raises what is a finding."""
    file = Path(FOLDER.name) / "input"
    file.write_bytes(with_right_checksums(data))
    is_archive(file)
    for piece in PIECES:
        unpack_into(piece, file)
