"""sgf_align from the command line."""

import json

import numpy as np
import pytest
from PIL import Image

from test_tools import fails, repeat, run

FRAMES, WIDTH, HEIGHT = 6, 320, 200
FOCAL_PX, BASELINE_M, DISPARITY_PX, STEP_PX = 200, 0.2, 16, 2
STEP_M = STEP_PX / DISPARITY_PX * BASELINE_M


@pytest.fixture
def sequence(tmp_path):
    """A camera that slides to the right before a textured wall, in the layout of KITTI odometry."""
    rng = np.random.default_rng(3)
    coarse = Image.fromarray(rng.integers(0, 255, (HEIGHT // 4, 2 * WIDTH // 4), dtype=np.uint8))
    wall = np.asarray(coarse.resize((2 * WIDTH, HEIGHT), Image.BICUBIC))
    folder = tmp_path / "dataset" / "sequences" / "07"
    for k in range(FRAMES):
        for eye, shift in (("image_0", 0), ("image_1", DISPARITY_PX)):
            (folder / eye).mkdir(parents=True, exist_ok=True)
            x = STEP_PX * k + shift
            Image.fromarray(wall[:, x : x + WIDTH].copy()).save(folder / eye / f"{k:06d}.png")
    (folder / "times.txt").write_text("".join(f"{0.1 * k:.6f}\n" for k in range(FRAMES)))
    row = f"{FOCAL_PX} 0 {WIDTH / 2} {{}} 0 {FOCAL_PX} {HEIGHT / 2} 0 0 0 1 0\n"
    (folder / "calib.txt").write_text(
        "P0: " + row.format(0) + "P1: " + row.format(-FOCAL_PX * BASELINE_M)
    )
    return folder


def positions(folder):
    return np.loadtxt(folder / "trajectory.txt", ndmin=2)[:, 1:4]


def true_positions(frames):
    return np.outer(STEP_M * np.arange(frames), [1, 0, 0])


def test_tracks_a_sequence(sequence, tmp_path):
    out = tmp_path / "out"
    result = run("sgf_align", sequence, "-o", out)
    assert result.returncode == 0, result.stderr
    np.testing.assert_allclose(positions(out), true_positions(FRAMES), atol=0.002)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["frames"] == summary["posed"] == FRAMES and summary["keyframes"] >= 1
    states = [line.split(",")[1] for line in (out / "frames.csv").read_text().splitlines()[1:]]
    assert states == ["initialised"] + ["tracked"] * (FRAMES - 1)
    assert len((out / "timings.csv").read_text().splitlines()) == FRAMES + 1
    assert "residual: sgf" in (out / "options.yaml").read_text()


def test_changed_light_is_put_on_and_survived(sequence, tmp_path):
    out = tmp_path / "out"
    light = ["--change.exposure-low", "0.5", "--change.exposure-high", "0.6", "--change.period-s", "0.1"]
    assert run("sgf_align", sequence, "-o", out, *light).returncode == 0
    np.testing.assert_allclose(positions(out), true_positions(FRAMES), atol=0.004)


def test_a_run_is_repeated_by_its_options(sequence, tmp_path):
    flags = ["--alignment.residual", "ngv", "--change.exposure-low", "0.7"]
    first, again = repeat("sgf_align", sequence, "--frames", "3", flags=flags, out=tmp_path)
    assert (again / "trajectory.txt").read_bytes() == (first / "trajectory.txt").read_bytes()


def test_part_of_a_sequence(sequence, tmp_path):
    out = tmp_path / "out"
    assert run("sgf_align", sequence, "-o", out, "--from", "2", "--frames", "3").returncode == 0
    np.testing.assert_allclose(positions(out), true_positions(3), atol=0.002)


def test_a_missing_eye_is_skipped_and_counted(sequence, tmp_path):
    (sequence / "image_1" / "000003.png").unlink()
    out = tmp_path / "out"
    result = run("sgf_align", sequence, "-o", out)
    assert result.returncode == 0 and "left out: 1 x frame with a missing file" in result.stdout
    summary = json.loads((out / "summary.json").read_text())
    assert summary["skipped"] == 1 and summary["posed"] == FRAMES - 1


def test_the_table_of_residuals():
    result = run("sgf_align", "--list-residuals")
    assert result.returncode == 0
    names = [line.split()[0] for line in result.stdout.splitlines()]
    assert {"photo", "sgf", "ngv", "lssd", "photo_affine", "bit_planes"} <= set(names)


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["--alignment.residual", "foo"], "'foo' is unknown; known: photo"),
        (["--alignment.linearization", "inverse"], "'sgf' cannot be linearised at the reference"),
        (["--from", "6"], "--from: is 6; the sequence has 6 frames"),
        (["--frames", "0"], "--frames: is 0"),
        (["--layout", "foo"], "layout is 'foo'; known: euroc"),
        (["--change.period-s", "0"], "period_s: is 0"),
        (["--min-depth-m", "-1"], "min_depth_m: is -1"),
    ],
)
def test_bad_arguments(sequence, tmp_path, arguments, message):
    fails(run("sgf_align", sequence, "-o", tmp_path / "out", *arguments), message)


def test_an_image_of_another_size_is_named(sequence, tmp_path):
    image = sequence / "image_1" / "000002.png"
    Image.open(image).resize((100, 80)).save(image)
    result = run("sgf_align", sequence, "-o", tmp_path / "out")
    fails(result, f"{image}: has 100x80 px, the camera 320x200")


def test_a_folder_that_cannot_be_made_is_named_before_the_work(sequence, tmp_path):
    (tmp_path / "file").touch()
    out = tmp_path / "file" / "out"
    result = run("sgf_align", sequence, "-o", out)
    fails(result, f"{out}: cannot be made")
    assert "frames" not in result.stdout


def test_a_broken_image_is_named(sequence, tmp_path):
    (sequence / "image_0" / "000002.png").write_bytes(b"no image")
    fails(run("sgf_align", sequence, "-o", tmp_path / "out"), "000002.png")
