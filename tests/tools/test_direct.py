"""sgf_direct from the command line."""

import json

import numpy as np
import pytest
from PIL import Image

from test_tools import fails, repeat, run

FRAMES, WIDTH, HEIGHT, STEP_PX = 40, 320, 240, 1


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    """A camera that slides to the right before walls at three depths, in the layout of KITTI odometry."""
    rng = np.random.default_rng(3)
    wide = WIDTH + 3 * STEP_PX * FRAMES
    coarse = Image.fromarray(rng.integers(0, 255, (HEIGHT // 4, wide // 4), dtype=np.uint8))
    wall = np.asarray(coarse.resize((wide, HEIGHT), Image.BICUBIC))
    folder = tmp_path_factory.mktemp("direct") / "dataset" / "sequences" / "07"
    third = HEIGHT // 3
    for k in range(FRAMES):
        image = np.empty((HEIGHT, WIDTH), np.uint8)
        for wall_number in range(3):
            rows = slice(wall_number * third, (wall_number + 1) * third)
            x = (wall_number + 1) * STEP_PX * k
            image[rows] = wall[rows, x : x + WIDTH]
        for eye in ("image_0", "image_1"):
            (folder / eye).mkdir(parents=True, exist_ok=True)
            Image.fromarray(image).save(folder / eye / f"{k:06d}.png")
    (folder / "times.txt").write_text("".join(f"{0.1 * k:.6f}\n" for k in range(FRAMES)))
    row = f"200 0 {WIDTH / 2} {{}} 0 200 {HEIGHT / 2} 0 0 0 1 0\n"
    (folder / "calib.txt").write_text("P0: " + row.format(0) + "P1: " + row.format(-40))
    return folder


def test_tracks_one_camera(sequence, tmp_path):
    out = tmp_path / "out"
    result = run("sgf_direct", sequence, "-o", out, "--depth.residual", "sgf")
    assert result.returncode == 0, result.stderr
    poses = np.loadtxt(out / "trajectory.txt")
    assert len(poses) == FRAMES
    path = poses[:, 1:4] - poses[0, 1:4]
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    np.testing.assert_allclose(steps, steps.mean(), rtol=0.15)
    assert path[-1, 0] > 20 * np.abs(path[-1, 1:]).max()
    summary = json.loads((out / "summary.json").read_text())
    assert summary["frames"] == summary["posed"] == FRAMES and summary["segments"] == 1
    events = [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]
    assert [event["event"] for event in events[:2]] == ["map", "keyframe"]
    # A map begins with two key-frames.
    assert sum(event["event"] in ("map", "keyframe") for event in events) == summary["keyframes"]
    header, _, body = (out / "points.ply").read_bytes().partition(b"end_header\n")
    assert f"element vertex {summary['points']}".encode() in header
    assert len(body) == summary["points"] * (4 * 4 + 3 + 4)
    for name in ("frames.csv", "timings.csv"):
        assert len((out / name).read_text().splitlines()) == FRAMES + 1
    assert "residual: sgf" in (out / "options.yaml").read_text()


def test_takes_a_folder_as_dso_does(sequence, tmp_path):
    folder = tmp_path / "mono"
    folder.mkdir()
    (folder / "images").symlink_to(sequence / "image_0")
    (folder / "camera.txt").write_text(f"Pinhole 200 200 {WIDTH / 2} {HEIGHT / 2} 0\n{WIDTH} {HEIGHT}\ncrop\n")
    times = "".join(f"{k:06d} {0.1 * k:.6f} 2.5\n" for k in range(FRAMES))
    (folder / "times.txt").write_text(times)
    for source, out in ((sequence, "kitti"), (folder, "mono")):
        flags = ["--photometric", "none"] if source is folder else []
        result = run("sgf_direct", source, "-o", tmp_path / out, *flags)
        assert result.returncode == 0, result.stderr
    poses = [(tmp_path / out / "trajectory.txt").read_text() for out in ("kitti", "mono")]
    assert poses[0] == poses[1]
    # With its exposures, which are all the same, the map is nearly that.
    assert run("sgf_direct", folder, "-o", tmp_path / "exposed").returncode == 0
    exposed = np.loadtxt(tmp_path / "exposed" / "trajectory.txt")
    np.testing.assert_allclose(exposed, np.loadtxt(tmp_path / "mono" / "trajectory.txt"), atol=0.1)


def test_needs_depth_or_a_second_camera_for_alignment(sequence, tmp_path):
    (tmp_path / "images").symlink_to(sequence / "image_0")
    (tmp_path / "camera.txt").write_text(f"Pinhole 200 200 160 120 0\n{WIDTH} {HEIGHT}\n")
    fails(run("sgf_align", tmp_path, "-o", tmp_path / "out"), "has one camera and no depth")


def test_a_run_is_repeated_by_its_options(sequence, tmp_path):
    flags = ["--preset", "fast", "--depth.residual", "sgf", "--window.sigma-intrinsics", "0.1"]
    first, again = repeat("sgf_direct", sequence, "--frames", "20", flags=flags, out=tmp_path)
    assert (again / "trajectory.txt").read_bytes() == (first / "trajectory.txt").read_bytes()


def test_online_poses_are_those_of_tracked_frames(sequence, tmp_path):
    assert run("sgf_direct", sequence, "-o", tmp_path, "--preset", "fast").returncode == 0
    states = [line.split(",")[1] for line in (tmp_path / "frames.csv").read_text().splitlines()[1:]]
    online = np.loadtxt(tmp_path / "trajectory_online.txt")
    assert len(online) == states.count("tracked") < FRAMES


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["--preset", "slow"], "'slow' is unknown; known: default, dense, fast"),
        (["--depth.residual", "lssd"], "'lssd' cannot estimate depth"),
        (["--window.residual", "bit_planes"], "'bit_planes' cannot refine a window"),
        (["--active-points", "5"], "active_points"),
        (["--from", "99"], "--from: is 99"),
        (["--frames", "0"], "--frames: is 0"),
        (["--photometric", "/nonexistent"], "has none of pcalib.txt"),
    ],
)
def test_bad_arguments_are_refused(sequence, tmp_path, arguments, message):
    fails(run("sgf_direct", sequence, "-o", tmp_path / "out", *arguments), message)


def test_a_calibration_of_the_wrong_length_is_refused(sequence, tmp_path):
    (tmp_path / "pcalib.txt").write_text(" ".join(str(k) for k in range(255)) + "\n")
    result = run("sgf_direct", sequence, "-o", tmp_path / "out", "--photometric", tmp_path)
    fails(result, "pcalib.txt")
