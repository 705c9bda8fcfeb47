"""docs/extending.md does what it says: its dissimilarity, put where it says, is seen in stereo, flow and alignment."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from rebuild import Rebuild
from test_align import STEP_M, positions, sequence, true_positions  # noqa: F401: fixtures
from test_tools import SHIFT, pair, read_pfm, scene  # noqa: F401
from test_vio import FLAGS, expect_slide, whole  # noqa: F401

PROJECT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ["SGF_BUILD_DIR"])
GUIDE = (PROJECT / "docs" / "extending.md").read_text()
END = "\n}  // namespace sgf::metrics\n"


def code_of(guide):
    """The guide's first block of C++, without the indentation of its list."""
    block = re.search(r"^ *```cpp\n(.*?)^ *```$", guide, re.MULTILINE | re.DOTALL).group(1)
    return "".join(line.removeprefix("   ") for line in block.splitlines(keepends=True))


def edit(path, old, new):
    text = path.read_text()
    assert text.count(old) == 1, f"{path}: '{old}' is there {text.count(old)} times"
    path.write_text(text.replace(old, new))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Runs a program of a copy of the project, changed as the guide says."""
    if not (BUILD / "build.ninja").exists():
        pytest.skip(f"{BUILD} is not Ninja's")
    folder = tmp_path_factory.mktemp("extended")
    shutil.copytree(PROJECT / "src", folder / "src")
    header, table = re.search(
        r"`src/(metrics/\w+\.h)` for `ngd`.*`MetricTypes` in `src/(\S+)`", GUIDE, re.DOTALL
    ).groups()
    edit(folder / "src" / header, END, f"\n{code_of(GUIDE)}{END}")
    edit(folder / "src" / table, "Lssd>;", "Lssd, Ngd>;")
    # The studies, which are not among these programs, lie in the library that all programs share.
    Rebuild(PROJECT, BUILD, folder)(["sgf_stereo", "sgf_align", "sgf_vio"], table, left_out=["sgf_apps"])

    def run_program(name, *arguments):
        command = [folder / "bin" / name, *map(str, arguments)]
        return subprocess.run(command, check=True, capture_output=True, text=True, timeout=300).stdout

    return run_program


def names(table):
    return [line.split()[0] for line in table.splitlines()]


def test_the_programs_list_it(run):
    assert names(run("sgf_stereo", "--list-metrics"))[-1] == "ngd"
    assert "ngd" in names(run("sgf_align", "--list-residuals"))


@pytest.mark.parametrize("method", ["bm", "mesh", "sgm"])
def test_stereo_matches_by_it(run, pair, tmp_path, method):  # noqa: F811
    flags = ["--metric", "ngd", "--method", method, "--window", 9, "--max-disp", 16]
    run("sgf_stereo", *pair, "-o", tmp_path / "out", *flags)
    disparity = read_pfm(tmp_path / "out" / "disparity.pfm")[:, 16:]
    found = np.isfinite(disparity)
    assert found.mean() > 0.8
    assert np.mean(np.abs(disparity[found] - SHIFT) < 0.5) > 0.98
    assert "metric: ngd" in (tmp_path / "out" / "options.yaml").read_text()


def test_alignment_tracks_by_it(run, sequence, tmp_path):  # noqa: F811
    run("sgf_align", sequence, "-o", tmp_path / "out", "--alignment.residual", "ngd")
    path = positions(tmp_path / "out")
    np.testing.assert_allclose(path, true_positions(len(path)), atol=0.2 * STEP_M)
    assert "residual: ngd" in (tmp_path / "out" / "options.yaml").read_text()


def test_flow_follows_patches_by_it(run, whole, tmp_path):  # noqa: F811
    run("sgf_vio", whole, "-o", tmp_path / "out", *FLAGS, "--flow.residual", "ngd")
    expect_slide(tmp_path / "out")
    assert "residual: ngd" in (tmp_path / "out" / "options.yaml").read_text()
