"""docs/runners/vslam_lab/run on a tiny sequence in VSLAM-LAB's layout."""

import csv
import os
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
from test_tools import BUILD
from test_vio import FRAMES, PERIOD_NS, SPEED, times, whole  # noqa: F401: a fixture

HERE = Path(__file__).resolve().parents[2] / "docs" / "runners" / "vslam_lab"
DESCRIPTION = yaml.safe_load((HERE / "sgf.yaml").read_text())
COLUMNS = ["ts (ns)", "tx (m)", "ty (m)", "tz (m)", "qx", "qy", "qz", "qw"]
FLOW = {"flow": {"residual": "ngv", "cell_px": 30, "levels": 3}}


def camera(k, sensor):
    fx, fy, cx, cy = sensor["intrinsics"]
    return {
        "cam_name": f"rgb_{k}", "cam_type": "gray", "cam_model": "pinhole", "distortion_type": "radtan5",
        "focal_length": [fx, fy], "principal_point": [cx, cy], "distortion_coefficients": [0, 0, 0, 0, 0],
        "image_dimension": sensor["resolution"], "fps": 20.0, "T_BS": sensor["T_BS"]["data"],
    }  # fmt: skip


IMU = {
    "imu_name": "imu_0", "sigma_g_c": 1.7e-4, "sigma_a_c": 2e-3, "sigma_gw_c": 2e-5, "sigma_aw_c": 3e-3, "fps": 200.0,
    "T_BS": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
}  # fmt: skip


def write_calibration(path, content):
    path.write_text(f"%YAML 1.2\n---\n{yaml.safe_dump(content)}")


@pytest.fixture
def lab(whole, tmp_path):  # noqa: F811
    """The sequence of sgf_vio's tests as VSLAM-LAB has it, and a folder of an experiment."""
    mav0, sequence = whole / "mav0", tmp_path / "BENCH" / "slide"
    sequence.mkdir(parents=True)
    cameras = [yaml.safe_load((mav0 / f"cam{k}" / "sensor.yaml").read_text()) for k in range(2)]
    rows = ["ts_rgb_0 (ns),path_rgb_0,ts_rgb_1 (ns),path_rgb_1"]
    for time in times():  # the right camera's clock is not the left one's
        rows.append(f"{time},rgb_0/{time}.png,{time + 7},rgb_1/{time}.png")
    (sequence / "rgb.csv").write_text("\n".join(rows) + "\n")
    for k in range(2):
        (sequence / f"rgb_{k}").symlink_to(mav0 / f"cam{k}" / "data")
    content = {"cameras": [camera(k, sensor) for k, sensor in enumerate(cameras)], "imus": [dict(IMU)]}
    write_calibration(sequence / "calibration.yaml", content)
    head = "ts (ns),wx (rad s^-1),wy (rad s^-1),wz (rad s^-1),ax (m s^-2),ay (m s^-2),az (m s^-2)\n"
    (sequence / "imu_0.csv").write_text(head + (mav0 / "imu0" / "data.csv").read_text().split("\n", 1)[1])
    (tmp_path / "exp").mkdir()
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump({"stereo": FLOW, "stereo-vi": FLOW}))
    return tmp_path


def call(lab, mode, **changed):  # noqa: F811
    """Runs the command that the description has for a mode."""
    values = {
        "runner": HERE / "run", "sequence_path": lab / "BENCH" / "slide",
        "calibration_yaml": lab / "BENCH" / "slide" / "calibration.yaml",
        "rgb_csv": lab / "BENCH" / "slide" / "rgb.csv",
        "exp_folder": lab / "exp", "exp_id": 3, "settings_yaml": lab / "settings.yaml", "mode": mode, "verbose": 1,
        "bin": BUILD / "bin", **changed,
    }  # fmt: skip
    command = [word.format(**values) for word in shlex.split(DESCRIPTION["command"])]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, stdin=subprocess.DEVNULL)


def trajectory(lab):
    with open(lab / "exp" / "00003_KeyFrameTrajectory.csv", newline="") as file:
        head, *rows = csv.reader(file)
    assert head == COLUMNS
    return [int(row[0]) for row in rows], np.array([row[1:] for row in rows], float)


def fails(lab, result, code, message):
    """No trajectory, which VSLAM-LAB takes for success, and the reason."""
    assert result.returncode == code and message in result.stderr, result.stderr
    assert not list((lab / "exp").glob("*.csv"))


@pytest.mark.parametrize("mode", ["stereo", "stereo-vi"])
def test_stereo_gives_the_bodys_path(lab, mode):
    result = call(lab, mode)
    assert result.returncode == 0, result.stderr
    found_ns, poses = trajectory(lab)
    assert found_ns == times()
    length = np.linalg.norm(poses[-1, :3] - poses[5, :3])
    assert length == pytest.approx(SPEED * 1e-9 * PERIOD_NS * (FRAMES - 6), rel=0.05)
    np.testing.assert_allclose(np.linalg.norm(poses[:, 3:], axis=1), 1, atol=1e-6)
    summary = yaml.safe_load((lab / "exp" / "00003_sgf" / "summary.json").read_text())
    assert (summary["imu"]["taken"] > 0) == (mode == "stereo-vi")
    options = (lab / "exp" / "00003_sgf" / "options.yaml").read_text()
    assert "residual: ngv" in options and "cell_px: 30" in options


def test_mono_takes_the_left_images_of_the_list_alone(lab):
    listed = lab / "exp" / "rgb_exp"
    rows = (lab / "BENCH" / "slide" / "rgb.csv").read_text().splitlines()
    listed.write_text("\n".join(rows[:1] + rows[3:]) + "\n")
    result = call(lab, "mono", rgb_csv=listed)
    assert result.returncode == 0, result.stderr
    found_ns, poses = trajectory(lab)
    assert found_ns == times()[2:]
    steps = np.diff(poses[:, :3], axis=0)  # of the camera, to the right, in a scale of its own
    assert (steps[:, 0] > 5 * np.abs(steps[:, 1:]).max(axis=1)).all()


def test_the_body_is_the_inertial_sensor(lab):
    """Where it is not the calibration's body, cameras are moved into its frame."""
    calibration = lab / "BENCH" / "slide" / "calibration.yaml"
    content = yaml.safe_load(calibration.read_text())
    turn = np.array([[0, -1, 0, 0.3], [1, 0, 0, -0.2], [0, 0, 1, 0.1], [0, 0, 0, 1.0]])
    for sensor in (*content["cameras"], *content["imus"]):
        sensor["T_BS"] = (turn @ np.reshape(sensor["T_BS"], (4, 4))).ravel().tolist()
    assert call(lab, "stereo-vi").returncode == 0
    straight = trajectory(lab)
    write_calibration(calibration, content)
    assert call(lab, "stereo-vi").returncode == 0
    np.testing.assert_allclose(trajectory(lab)[1], straight[1], atol=1e-4)


def test_a_failing_program_leaves_no_trajectory(lab):
    (lab / "exp" / "00003_KeyFrameTrajectory.csv").write_text("of an earlier run\n")
    (lab / "settings.yaml").write_text("stereo-vi: {flow: {residual: nonsense}}\n")
    fails(lab, call(lab, "stereo-vi"), 2, "nonsense")


def test_a_program_that_dies_gives_its_exit_code(lab):
    (lab / "bin").mkdir()
    program = lab / "bin" / "sgf_vio"
    program.write_text("#!/bin/sh\nexit 7\n")
    program.chmod(0o755)
    fails(lab, call(lab, "stereo", bin=lab / "bin"), 7, "")


def test_no_pose_is_a_failure(lab):
    (lab / "bin").mkdir()
    program = lab / "bin" / "sgf_direct"
    program.write_text('#!/bin/sh\nmkdir -p "$3" && echo "# time x y z" >"$3/trajectory.txt"\n')
    program.chmod(0o755)
    fails(lab, call(lab, "mono", bin=lab / "bin"), 2, "has no pose")


@pytest.mark.parametrize(
    "changed, message",
    [
        ({"mode": "rgbd"}, "mode: is 'rgbd'; known: mono, stereo, stereo-vi"),
        ({"exp_id": "x"}, "exp_id: is 'x'"),
        ({"settings_yaml": ""}, "argument settings_yaml: is missing"),
        ({"settings_yaml": "/nowhere.yaml"}, "/nowhere.yaml"),
        ({"rgb_csv": "/nowhere.csv"}, "/nowhere.csv"),
        ({"bin": "/nowhere"}, "/nowhere/sgf_vio"),
    ],
)
def test_bad_arguments_are_refused(lab, changed, message):
    fails(lab, call(lab, **({"mode": "stereo-vi"} | changed)), 2, message)


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda content: content["cameras"].pop(), "has no sensor rgb_1"),
        (lambda content: content["cameras"][0].pop("fps"), "rgb_0 has no fps"),
        (lambda content: content["cameras"][0].update(distortion_type="equid4"), "rgb_0 is pinhole, equid4"),
        (
            lambda content: content["cameras"][1]["distortion_coefficients"].__setitem__(4, 0.1),
            "third radial coefficient",
        ),
        (lambda content: content["imus"][0].update(T_BS=[1, 2]), "T_BS of imu_0 is no 4x4 matrix"),
    ],
)
def test_a_calibration_that_cannot_be_shown_is_refused(lab, change, message):
    calibration = lab / "BENCH" / "slide" / "calibration.yaml"
    content = yaml.safe_load(calibration.read_text())
    change(content)
    write_calibration(calibration, content)
    fails(lab, call(lab, "stereo-vi"), 2, message)


def test_the_description_names_what_is_there():
    assert set(DESCRIPTION["modes"]) == {"mono", "stereo", "stereo-vi"}
    settings = yaml.safe_load((HERE / DESCRIPTION["settings"]).read_text())
    assert set(settings) <= set(DESCRIPTION["modes"])
    assert os.access(HERE / DESCRIPTION["runner"], os.X_OK)
