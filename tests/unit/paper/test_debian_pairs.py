"""Conversion of the pairs that Debian packages ship, from imitations of the packages."""

import gzip
import os
import subprocess

import numpy as np
import pytest
from PIL import Image

from sgf_paper import images, paths

SCRIPT = paths.PROJECT / "datasets" / "debian_pairs.py"
SKIMAGE = "usr/lib/python3/dist-packages/skimage/data"
OPENCV_DOC = "usr/share/doc/opencv-doc/examples/data"


@pytest.fixture
def system(tmp_path):
    """A root folder with both packages: 6x4 images, disparities up to 15.5 and 32."""
    root = tmp_path / "root"
    for folder in (SKIMAGE, OPENCV_DOC):
        (root / folder).mkdir(parents=True)
    picture = Image.fromarray(np.arange(72, dtype=np.uint8).reshape(4, 6, 3))
    for side in ("left", "right"):
        picture.save(root / SKIMAGE / f"motorcycle_{side}.png")
    for side in "LR":
        picture.save(root / OPENCV_DOC / f"aloe{side}.jpg")
    disparity = np.full((4, 6), 15.5, dtype=np.float32)
    disparity[0, 0], disparity[1, 2] = np.inf, 3.25
    np.savez_compressed(root / SKIMAGE / "motorcycle_disp.npz", disparity)
    grey = np.full((4, 6), 32, dtype=np.uint8)
    grey[3, 5] = 0
    Image.fromarray(grey).save(root / OPENCV_DOC / "aloeGT.png")
    return root


def convert(root, out):
    command = ["/usr/bin/python3", SCRIPT, "--root", root, out]
    return subprocess.run(command, capture_output=True, text=True)


def test_both_pairs_in_middleburys_layout(system, tmp_path):
    out = tmp_path / "pairs"
    assert convert(system, out).returncode == 0
    for name in ("Motorcycle", "Aloe"):
        files = sorted(path.name for path in (out / name).iterdir())
        assert files == ["calib.txt", "disp0GT.pfm", "im0.png", "im1.png"]
    truth = images.read_pfm(out / "Motorcycle" / "disp0GT.pfm")
    assert truth.shape == (4, 6)
    assert np.isnan(truth[0, 0]) and truth[1, 2] == 3.25 and truth[3, 5] == 15.5
    aloe = images.read_pfm(out / "Aloe" / "disp0GT.pfm")
    assert np.isnan(aloe[3, 5]) and aloe[0, 0] == 32
    assert list(out.parent.glob("tmp*")) == []


def test_ndisp_is_the_next_multiple_of_16_above_the_largest_disparity(system, tmp_path):
    convert(system, tmp_path / "pairs")
    assert images.read_num_disparities(tmp_path / "pairs" / "Motorcycle" / "calib.txt") == 16
    assert images.read_num_disparities(tmp_path / "pairs" / "Aloe" / "calib.txt") == 48


def test_a_missing_package_is_named_and_the_other_pair_made(system, tmp_path):
    (system / OPENCV_DOC / "aloeGT.png").unlink()
    done = convert(system, tmp_path / "pairs")
    assert done.returncode == 0
    assert "Aloe left out: package opencv-doc does not provide" in done.stdout
    assert not (tmp_path / "pairs" / "Aloe").exists()
    assert (tmp_path / "pairs" / "Motorcycle").exists()


def test_compressed_documentation_is_read(system, tmp_path):
    plain = system / OPENCV_DOC / "aloeL.jpg"
    (system / OPENCV_DOC / "aloeL.jpg.gz").write_bytes(gzip.compress(plain.read_bytes()))
    plain.unlink()
    assert convert(system, tmp_path / "pairs").returncode == 0
    assert (tmp_path / "pairs" / "Aloe" / "im0.png").exists()


def test_without_any_pair_the_error_names_the_packages(tmp_path):
    done = convert(tmp_path / "nothing", tmp_path / "pairs")
    assert done.returncode == 1
    assert "python3-skimage opencv-doc" in done.stderr
    assert not (tmp_path / "pairs").exists()


def test_a_pair_is_made_anew_only_when_its_sources_are_newer(system, tmp_path):
    calibration = tmp_path / "pairs" / "Aloe" / "calib.txt"
    convert(system, tmp_path / "pairs")
    first = calibration.stat().st_mtime_ns
    assert convert(system, tmp_path / "pairs").stdout == ""
    assert calibration.stat().st_mtime_ns == first
    later = first / 1e9 + 10
    os.utime(system / OPENCV_DOC / "aloeGT.png", (later, later))
    assert "Aloe converted" in convert(system, tmp_path / "pairs").stdout
    assert calibration.stat().st_mtime_ns != first


def test_truth_of_another_size_is_an_error_and_leaves_nothing(system, tmp_path):
    Image.fromarray(np.ones((4, 5), dtype=np.uint8)).save(system / OPENCV_DOC / "aloeGT.png")
    done = convert(system, tmp_path / "pairs")
    assert done.returncode == 1
    assert "im0.png is (6, 4), its ground truth (5, 4)" in done.stderr
    assert not (tmp_path / "pairs" / "Aloe").exists()
