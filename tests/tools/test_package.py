"""The installed package from other projects: the examples of docs/ and a program of one library."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from test_tools import BUILD, SHIFT, pair, read_pfm, scene  # noqa: F401
from test_vio import BASELINE_M, DISPARITY_PX, FRAMES, STEP_PX, whole  # noqa: F401

HERE = Path(__file__).resolve().parent
STEP_M = STEP_PX / DISPARITY_PX * BASELINE_M  # to the right, a frame


def run(*command):
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=600)


def output_of(*command):
    result = run(*command)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    folder = tmp_path_factory.mktemp("prefix")
    output_of("cmake", "--install", BUILD, "--component", "libsgf-dev", "--prefix", folder)
    return folder


def build(sources, prefix, folder, *flags):
    """Builds a project against the installed package."""
    output_of("cmake", "-S", sources, "-B", folder, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}", *flags)
    output_of("cmake", "--build", folder)
    return folder


@pytest.fixture(scope="module")
def examples(prefix, tmp_path_factory):
    return build(prefix / "share" / "sgf" / "examples", prefix, tmp_path_factory.mktemp("examples"))


def path_of(trajectory):
    poses = np.loadtxt(trajectory, ndmin=2)[:, 1:4]
    return poses - poses[0]


def without(*packages):
    return [f"-DCMAKE_DISABLE_FIND_PACKAGE_{package}=ON" for package in packages]


def test_a_program_that_swaps_the_matcher_needs_what_matching_needs(prefix, tmp_path):
    folder = build(HERE / "consumer", prefix, tmp_path, *without("Ceres", "embree", "OpenEXR", "OpenSSL"))
    assert output_of(folder / "consumer") == "disparity 7\n"


@pytest.mark.parametrize(
    "asked, missing, told",
    [
        ("REQUIRED", [], "found: core metrics stereo io eval synth alignment odometry direct flow vio"),
        ("REQUIRED", ["embree"], "sgf::synth needs embree"),
        ("REQUIRED COMPONENTS flow odometry", ["Ceres"], "found: core metrics stereo alignment odometry flow"),
        ("REQUIRED COMPONENTS vio", ["Ceres"], "sgf::vio needs Ceres::ceres"),
        ("REQUIRED COMPONENTS eval synth", ["OpenSSL"], "sgf::io needs OpenSSL::Crypto"),
        ("REQUIRED COMPONENTS eval OPTIONAL_COMPONENTS vio", ["Ceres"], "found: core metrics eval alignment flow"),
        ("REQUIRED COMPONENTS stero", [], "There is no sgf::stero"),
    ],
)
def test_components(prefix, tmp_path, asked, missing, told):
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(asks LANGUAGES CXX)\nset(OpenCV_LIBS mine)\n"
        f"find_package(sgf {asked})\n"
        "foreach(name core metrics stereo io eval synth alignment odometry direct flow vio)\n"
        '  if(TARGET sgf::${name} AND sgf_${name}_FOUND)\n    string(APPEND found " ${name}")\n  endif()\n'
        'endforeach()\nmessage(STATUS "found:${found}; OpenCV_LIBS: ${OpenCV_LIBS}")\n'
    )
    flags = ["-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}", *without(*missing)]
    result = run("cmake", "-S", tmp_path, "-B", tmp_path / "build", *flags)
    assert (result.returncode == 0) == told.startswith("found")
    if told.startswith("found"):
        assert f"-- {told}; OpenCV_LIBS: mine\n" in result.stdout
    else:
        assert told in " ".join(result.stderr.split())


def test_the_matcher_writes_disparities(examples, pair, tmp_path):  # noqa: F811
    told = output_of(examples / "stereo_matcher", *pair, tmp_path / "out.pfm")
    disparity = read_pfm(tmp_path / "out.pfm")
    matched = np.isfinite(disparity)
    assert told == f"{matched.sum()} of {matched.size} pixels are matched\n"
    assert matched.mean() > 0.8 and np.abs(disparity[matched] - SHIFT).mean() < 0.1


def test_optical_flow_follows_points(examples, whole):  # noqa: F811
    lines = output_of(examples / "optical_flow", whole).splitlines()
    assert len(lines) == FRAMES
    counts = [list(map(int, re.findall(r" (\d+) ", line))) for line in lines]
    assert all(followed > 10 and stereo > 10 for followed, _, _, stereo in counts[1:])


def test_two_frames_are_aligned(examples, whole):  # noqa: F811
    told = output_of(examples / "direct_alignment", whole)
    moved = list(map(float, re.search("by(.*) m", told)[1].split()))
    np.testing.assert_allclose(moved, [STEP_M, 0, 0], atol=0.05 * STEP_M)


def test_keyframe_odometry_finds_the_path(examples, whole, tmp_path):  # noqa: F811
    told = output_of(examples / "keyframe_odometry", whole, tmp_path / "path.txt")
    assert told == f"{FRAMES} of {FRAMES} frames have a pose\n"
    truth = np.outer(STEP_M * np.arange(FRAMES), [1, 0, 0])
    np.testing.assert_allclose(path_of(tmp_path / "path.txt"), truth, atol=0.05 * truth.max())


def test_stereo_inertial_odometry_finds_the_path(examples, whole, tmp_path):  # noqa: F811
    told = output_of(examples / "stereo_inertial_odometry", whole, tmp_path / "path.txt")
    assert told == f"{FRAMES} of {FRAMES} frames have a pose\n"
    path = path_of(tmp_path / "path.txt")
    np.testing.assert_allclose(np.linalg.norm(path[-1]), STEP_M * (FRAMES - 1), rtol=0.1)


@pytest.mark.parametrize(
    "name, arguments",
    [
        ("stereo_matcher", 3),
        ("optical_flow", 1),
        ("direct_alignment", 1),
        ("keyframe_odometry", 2),
        ("stereo_inertial_odometry", 2),
    ],
)
def test_examples_say_what_is_wrong(examples, tmp_path, name, arguments):
    usage = run(examples / name)
    assert usage.returncode == 2 and usage.stderr.startswith(f"usage: {name} ")
    missing = run(examples / name, *[tmp_path / "missing"] * arguments)
    assert missing.returncode == 2 and str(tmp_path / "missing") in missing.stderr
