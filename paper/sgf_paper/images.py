"""Reads images and disparity maps for figures."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from PIL import Image


def read_grey(path: Path) -> np.ndarray:
    """An image as 8-bit grey levels."""
    return np.asarray(Image.open(path).convert("L"))


def read_pfm(path: Path) -> np.ndarray:
    """A one-channel PFM file, top row first; infinite values become NaN."""
    with path.open("rb") as file:
        kind, size, scale = (file.readline().split() for _ in range(3))
        if kind != [b"Pf"]:
            raise ValueError(f"{path}: not a one-channel PFM file")
        width, height = (int(number) for number in size)
        order = "<" if float(scale[0]) < 0 else ">"
        values = np.frombuffer(file.read(4 * width * height), dtype=f"{order}f4")
    disparity = values.reshape(height, width)[::-1].astype(np.float32)
    return np.where(np.isfinite(disparity), disparity, np.nan)


def read_disparity(path: Path) -> np.ndarray:
    """Disparities in px, NaN for none: PFM, or KITTI's 16-bit PNG (value/256, 0 for none)."""
    if path.suffix == ".pfm":
        return read_pfm(path)
    values = np.asarray(Image.open(path)).astype(np.float32) / 256
    return np.where(values > 0, values, np.nan)


def read_num_disparities(calibration: Path) -> int:
    """The number of disparities that a Middlebury calib.txt states."""
    found = re.search(r"^ndisp=(\d+)", calibration.read_text(), re.MULTILINE)
    if not found:
        raise ValueError(f"{calibration}: no line ndisp=")
    return int(found.group(1))
