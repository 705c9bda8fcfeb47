"""sgf_vio from the command line."""

import json
import shutil

import numpy as np
import pytest
from PIL import Image

from test_tools import fails, repeat, run

FRAMES, WIDTH, HEIGHT = 20, 320, 240
FOCAL_PX, BASELINE_M, DISPARITY_PX, STEP_PX = 200, 0.2, 16, 2
START_NS, PERIOD_NS, IMU_NS = 1403636579763555584, 50_000_000, 5_000_000
SPEED = STEP_PX / DISPARITY_PX * BASELINE_M / (1e-9 * PERIOD_NS)  # m/s
HEADER = (
    "time_ns,state,segment,vx_m_s,vy_m_s,vz_m_s,bgx_rad_s,bgy_rad_s,bgz_rad_s,bax_m_s2,bay_m_s2,baz_m_s2,"
    "sigma_rotation_rad,sigma_position_m,sigma_velocity_m_s,sigma_gyro_bias_rad_s,sigma_accel_bias_m_s2,"
    "keyframe,tracks,stereo_tracks,landmarks,outliers,iterations"
)

CAMERA = """sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0, 0, 1, 0, -1, 0, 0, {y}, 0, -1, 0, 0, 0, 0, 0, 1]
rate_hz: 20
resolution: [{width}, {height}]
camera_model: pinhole
intrinsics: [{focal}, {focal}, {cx}, {cy}]
distortion_model: radial-tangential
distortion_coefficients: [0, 0, 0, 0]
"""

IMU = """sensor_type: imu
T_BS:
  cols: 4
  rows: 4
  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
rate_hz: 200
gyroscope_noise_density: 1.7e-4
gyroscope_random_walk: 2.0e-5
accelerometer_noise_density: 2.0e-3
accelerometer_random_walk: 3.0e-3
"""


def times():
    return [START_NS + k * PERIOD_NS for k in range(FRAMES)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A body (x forwards, z up) at constant velocity to its right, before a wall, in EuRoC's layout."""
    rng = np.random.default_rng(3)
    coarse = Image.fromarray(rng.integers(0, 255, (HEIGHT // 4, 2 * WIDTH // 4), dtype=np.uint8))
    wall = np.asarray(coarse.resize((2 * WIDTH, HEIGHT), Image.BICUBIC))
    mav0 = tmp_path_factory.mktemp("vio") / "slide" / "mav0"
    for camera, shift in enumerate((0, DISPARITY_PX)):
        folder = mav0 / f"cam{camera}"
        (folder / "data").mkdir(parents=True)
        (folder / "sensor.yaml").write_text(
            CAMERA.format(
                y=-camera * BASELINE_M, width=WIDTH, height=HEIGHT, focal=FOCAL_PX, cx=WIDTH / 2, cy=HEIGHT / 2
            )
        )
        for k, time in enumerate(times()):
            x = STEP_PX * k + shift
            Image.fromarray(wall[:, x : x + WIDTH].copy()).save(folder / "data" / f"{time}.png")
        rows = "".join(f"{time},{time}.png\n" for time in times())
        (folder / "data.csv").write_text("#timestamp [ns],filename\n" + rows)
    imu = mav0 / "imu0"
    imu.mkdir()
    (imu / "sensor.yaml").write_text(IMU)
    samples = range(START_NS - PERIOD_NS, times()[-1] + PERIOD_NS, IMU_NS)
    rows = "".join(f"{time},0,0,0,0,0,9.81\n" for time in samples)
    (imu / "data.csv").write_text("#timestamp [ns],gyro x, y, z [rad s^-1],accel x, y, z [m s^-2]\n" + rows)
    return mav0.parent


@pytest.fixture
def sequence(whole, tmp_path):
    """A copy that may be spoilt."""
    return shutil.copytree(whole, tmp_path / "slide")


FLAGS = ["--flow.cell-px", "30", "--flow.levels", "3"]


def track(sequence, out, *flags):
    result = run("sgf_vio", sequence, "-o", out, *FLAGS, *flags)
    assert result.returncode == 0, result.stderr
    return result


def states(folder):
    lines = (folder / "states.csv").read_text().splitlines()
    assert lines[0] == HEADER
    return [dict(zip(HEADER.split(","), line.split(","), strict=True)) for line in lines[1:]]


def expect_slide(folder):
    """The motion is along -y of the body, which is the world's but for a turn about z. The inertial sensor takes
    constant velocity for rest, which the first frames have to put right."""
    settled = 5
    path = np.loadtxt(folder / "trajectory.txt", ndmin=2)[:, 1:4]
    truth = SPEED * 1e-9 * PERIOD_NS * np.arange(FRAMES)
    path, truth = path[settled:] - path[settled], truth[settled:] - truth[settled]
    np.testing.assert_allclose(path, np.outer(truth, [0, -1, 0]), atol=0.02 * truth[-1])


def test_tracks_a_sequence(whole, tmp_path):
    out = tmp_path / "out"
    track(whole, out, "--flow.residual", "ngv")
    expect_slide(out)
    rows = states(out)
    assert [int(row["time_ns"]) for row in rows] == times()
    assert {row["state"] for row in rows} == {"tracked"} and {row["segment"] for row in rows} == {"0"}
    last = rows[-1]
    assert abs(float(last["vy_m_s"]) + SPEED) < 0.03 * SPEED and abs(float(last["vx_m_s"])) < 0.03 * SPEED
    sigmas = [float(value) for key, value in last.items() if key.startswith("sigma")]
    assert all(0 <= sigma < 1 for sigma in sigmas) and all(sigma > 0 for sigma in sigmas[:2])
    summary = json.loads((out / "summary.json").read_text())
    assert summary["sequence"] == "slide" and summary["states"] == {"tracked": FRAMES}
    assert summary["frames"] == summary["posed"] == FRAMES
    assert summary["segments"] == 1 and summary["dropped"] == summary["skipped"] == 0
    assert summary["imu"]["taken"] == (FRAMES - 1) * PERIOD_NS // IMU_NS + PERIOD_NS // IMU_NS + 1
    events = [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]
    assert [event["event"] for event in events[:2]] == ["keyframe", "tracked"]
    assert sum(event["event"] == "keyframe" for event in events) == summary["keyframes"]
    header, _, body = (out / "points.ply").read_bytes().partition(b"end_header\n")
    assert f"element vertex {summary['points']}" in " ".join(header.decode().split())
    assert summary["points"] > 20
    assert len(body) == summary["points"] * (4 * 4 + 3 + 4)
    timings = (out / "timings.csv").read_text().splitlines()
    assert len(timings) == FRAMES + 1 and timings[0].startswith("time_ns,pyramid_ms")
    assert "residual: ngv" in (out / "options.yaml").read_text()
    found = {"trajectory.txt", "states.csv", "covariances.csv", "points.ply"}
    about = {"timings.csv", "events.jsonl", "summary.json", "options.yaml"}
    assert {path.name for path in out.iterdir()} == found | about


def test_calibration_is_written_when_it_is_estimated(whole, tmp_path):
    out = tmp_path / "out"
    track(whole, out, "--calibration.time-offset-sd-s", "0.01", "--start-s", "0.2")
    expect_slide(out)
    header, *rows = (out / "calibration.csv").read_text().splitlines()
    assert header.startswith("time_ns,time_offset_s,rx_rad") and len(rows) == FRAMES
    last = dict(zip(header.split(","), map(float, rows[-1].split(",")), strict=True))
    assert abs(last["time_offset_s"]) <= 0.02 and 0 <= last["sigma_time_offset_s"] <= 0.01 + 1e-6
    assert last["sigma_rotation_rad"] < 1e-6  # taken as right
    refused = run("sgf_vio", whole, "-o", tmp_path / "no", "--calibration.time-offset-sd-s", "1")
    assert refused.returncode == 2 and "calibration.time_offset_sd_s" in refused.stderr


def test_a_run_is_repeated_by_its_options(whole, tmp_path):
    flags = [*FLAGS, "--flow.residual", "ngv", "--window.gravity", "9.8"]
    first, again = repeat("sgf_vio", whole, "--frames", "6", flags=flags, out=tmp_path)
    assert (again / "states.csv").read_bytes() == (first / "states.csv").read_bytes()


def test_is_the_same_for_any_number_of_threads(whole, tmp_path):
    for threads in ("1", "2"):
        track(whole, tmp_path / threads, "--threads", threads)
    for name in ("trajectory.txt", "states.csv", "points.ply"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()


def test_part_of_a_sequence(whole, tmp_path):
    track(whole, tmp_path, "--from", "5", "--frames", "6")
    assert [int(row["time_ns"]) for row in states(tmp_path)] == times()[5:11]


def test_goes_on_without_inertial_sensor(sequence, tmp_path):
    shutil.rmtree(sequence / "mav0" / "imu0")
    out = tmp_path / "out"
    result = track(sequence, out)
    assert "no inertial measurements" in result.stderr + result.stdout
    assert {row["state"] for row in states(out)} == {"tracked"}
    assert "inertial: false" in (out / "options.yaml").read_text()
    assert json.loads((out / "summary.json").read_text())["imu"]["taken"] == 0


def test_a_missing_image_is_skipped_and_counted(sequence, tmp_path):
    (sequence / "mav0" / "cam1" / "data" / f"{times()[7]}.png").unlink()
    out = tmp_path / "out"
    result = track(sequence, out)
    assert "left out: 1 x" in result.stderr + result.stdout
    summary = json.loads((out / "summary.json").read_text())
    assert summary["skipped"] == 1 and summary["posed"] == FRAMES - 1


def test_real_time_counts_dropped_frames(sequence, tmp_path):
    # All frames within 20 us: while one is worked on, all others come.
    new = {time: START_NS + k * 1000 for k, time in enumerate(times())}
    for camera in ("cam0", "cam1"):
        folder = sequence / "mav0" / camera
        for old, time in new.items():
            (folder / "data" / f"{old}.png").rename(folder / "data" / f"{time}.png")
        rows = "".join(f"{time},{time}.png\n" for time in new.values())
        (folder / "data.csv").write_text("#timestamp [ns],filename\n" + rows)
    out = tmp_path / "out"
    track(sequence, out, "--real-time")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["dropped"] == FRAMES - 2, "the first and the last are worked on"
    assert summary["frames"] == FRAMES and len(states(out)) == 2
    events = [json.loads(line)["event"] for line in (out / "events.jsonl").read_text().splitlines()]
    assert events.count("dropped") == FRAMES - 2
    track(sequence, out)
    assert json.loads((out / "summary.json").read_text())["dropped"] == 0


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["--from", "99"], "--from: is 99"),
        (["--frames", "0"], "--frames: is 0"),
        (["--states", "1"], "states: is 1"),
        (["--flow.residual", "foo"], "foo"),
        (["--window.sigma-px", "-1"], "window.sigma_px"),
        (["--layout", "foo"], "layout is 'foo'"),
    ],
)
def test_bad_arguments_are_refused(whole, tmp_path, arguments, message):
    fails(run("sgf_vio", whole, "-o", tmp_path / "out", *arguments), message)


def test_an_unknown_option_is_named(whole, tmp_path):
    result = run("sgf_vio", whole, "-o", tmp_path / "out", "--nonsense", "1")
    assert result.returncode == 2 and "--nonsense" in result.stderr


def test_a_missing_folder_is_named(tmp_path):
    fails(run("sgf_vio", tmp_path / "nowhere", "-o", tmp_path / "out"), "nowhere")


def test_one_camera_is_not_enough(sequence, tmp_path):
    shutil.rmtree(sequence / "mav0" / "cam1")
    fails(run("sgf_vio", sequence, "-o", tmp_path / "out"), "slide: is no stereo sequence")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_named_before_the_work(whole, tmp_path):
    (tmp_path / "file").write_text("")
    fails(run("sgf_vio", whole, "-o", tmp_path / "file" / "out"), "file")
