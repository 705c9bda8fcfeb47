#!/usr/bin/python3
"""Converts the stereo pairs with ground truth that Debian packages ship to Middlebury's layout.

python3-skimage has Motorcycle (Middlebury 2014, 741x500) and opencv-doc has Aloe (Middlebury 2006,
1282x1110). Each becomes a folder with im0.png, im1.png, disp0GT.pfm (px; inf: unknown) and calib.txt,
which states ndisp: the next multiple of 16 above the largest true disparity. A pair whose files are
not installed (minimal images leave /usr/share/doc out) is said to be missing; with none of them the
exit code is 1. A pair that is newer than its sources and this script is left as it is.
"""

from __future__ import annotations

import argparse
import gzip
import io
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import numpy as np
from PIL import Image

SKIMAGE = Path("usr/lib/python3/dist-packages/skimage/data")
OPENCV_DOC = Path("usr/share/doc/opencv-doc/examples/data")


def read_motorcycle_truth(data: bytes) -> np.ndarray:
    """Disparities in px, infinite where unknown."""
    disparity = np.load(io.BytesIO(data))["arr_0"].astype(np.float32)
    return np.where(np.isfinite(disparity), disparity, np.inf)


def read_aloe_truth(data: bytes) -> np.ndarray:
    """Disparities in px, infinite where unknown: the grey level is the disparity, 0 is unknown."""
    grey = np.asarray(Image.open(io.BytesIO(data)).convert("L")).astype(np.float32)
    return np.where(grey > 0, grey, np.inf)


@dataclass(frozen=True)
class Pair:
    """Where a package keeps a pair, below the root folder of the system."""

    name: str
    package: str
    left: Path
    right: Path
    truth: Path
    read_truth: Callable[[bytes], np.ndarray]

    @property
    def files(self) -> list[Path]:
        return [self.left, self.right, self.truth]


PAIRS = [
    Pair(
        "Motorcycle",
        "python3-skimage",
        SKIMAGE / "motorcycle_left.png",
        SKIMAGE / "motorcycle_right.png",
        SKIMAGE / "motorcycle_disp.npz",
        read_motorcycle_truth,
    ),
    Pair(
        "Aloe",
        "opencv-doc",
        OPENCV_DOC / "aloeL.jpg",
        OPENCV_DOC / "aloeR.jpg",
        OPENCV_DOC / "aloeGT.png",
        read_aloe_truth,
    ),
]


def find(root: Path, file: Path) -> Path | None:
    """The installed file, which Debian may have compressed."""
    for candidate in (root / file, root / f"{file}.gz"):
        if candidate.exists():
            return candidate
    return None


def read(path: Path) -> bytes:
    """Content of a file, unpacked if it is compressed."""
    return gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()


def write_pfm(path: Path, disparity: np.ndarray) -> None:
    """One-channel PFM, little endian, bottom row first."""
    height, width = disparity.shape
    with path.open("wb") as file:
        file.write(f"Pf\n{width} {height}\n-1\n".encode())
        file.write(disparity[::-1].astype("<f4").tobytes())


def num_disparities(disparity: np.ndarray) -> int:
    """The next multiple of 16 above the largest disparity."""
    return 16 * (int(disparity[np.isfinite(disparity)].max()) // 16 + 1)


def is_current(folder: Path, sources: list[Path]) -> bool:
    """Whether a converted pair is newer than what it was made from."""
    made = folder / "calib.txt"  # written last
    if not made.exists():
        return False
    newest = max(path.stat().st_mtime for path in [*sources, Path(__file__)])
    return made.stat().st_mtime >= newest


def write_pair(folder: Path, left: bytes, right: bytes, disparity: np.ndarray) -> None:
    """Writes one pair's files into an existing folder."""
    height, width = disparity.shape
    for name, data in (("im0.png", left), ("im1.png", right)):
        image = Image.open(io.BytesIO(data)).convert("RGB")
        if image.size != (width, height):
            raise ValueError(f"{name} is {image.size}, its ground truth {(width, height)}")
        image.save(folder / name)
    write_pfm(folder / "disp0GT.pfm", disparity)
    calibration = f"width={width}\nheight={height}\nndisp={num_disparities(disparity)}\n"
    (folder / "calib.txt").write_text(calibration)


def convert(pair: Pair, sources: list[Path], out: Path) -> None:
    """Makes a pair's folder under `out`, whole or not at all."""
    left, right, truth = (read(path) for path in sources)
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent) as work:
        folder = Path(work) / pair.name
        folder.mkdir()
        write_pair(folder, left, right, pair.read_truth(truth))
        shutil.rmtree(out / pair.name, ignore_errors=True)
        folder.rename(out / pair.name)


def make_pair(pair: Pair, root: Path, out: Path) -> bool:
    """Converts a pair if its files are installed; says what it did. True if the pair is there."""
    sources = [find(root, file) for file in pair.files]
    missing = [str(root / file) for file, source in zip(pair.files, sources) if source is None]
    if missing:
        shutil.rmtree(out / pair.name, ignore_errors=True)
        print(f"{pair.name} left out: package {pair.package} does not provide {', '.join(missing)}")
        return False
    if is_current(out / pair.name, sources):
        return True
    convert(pair, sources, out)
    print(f"{pair.name} converted from package {pair.package}")
    return True


def make_pairs(root: Path, out: Path) -> int:
    """Converts all pairs; the exit code of the program."""
    made = [make_pair(pair, root, out) for pair in PAIRS]
    if any(made):
        return 0
    if out.exists() and not any(out.iterdir()):
        out.rmdir()
    packages = " ".join(pair.package for pair in PAIRS)
    print(f"Error: no pair is installed; Debian packages: {packages}", file=sys.stderr)
    return 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder to write the pairs' folders into")
    parser.add_argument("--root", type=Path, default=Path("/"), help="root folder of the system")
    arguments = parser.parse_args()
    try:
        return make_pairs(arguments.root, arguments.out)
    except (OSError, ValueError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
