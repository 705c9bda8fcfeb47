"""sgf_eval trajectory from the command line."""

import json

import numpy as np
import pytest

from test_tools import fails, read_points, run, write_points

POSES = 60


def write_tum(path, positions, period=0.05):
    lines = [f"{100 + period * i:.9f} {x} {y} {z} 0 0 0 1" for i, (x, y, z) in enumerate(positions)]
    path.write_text("# time_s tx ty tz qx qy qz qw\n" + "\n".join(lines) + "\n")
    return path


@pytest.fixture
def walk():
    t = np.linspace(0, 3, POSES)
    return np.stack([np.cos(t), t, np.sin(2 * t)], axis=1)


@pytest.fixture
def truth(walk, tmp_path):
    return write_tum(tmp_path / "truth.txt", walk)


def scores_of(result, path):
    assert result.returncode == 0, result.stderr
    return json.loads(path.read_text())


def test_scores_go_to_the_terminal_and_into_a_file(truth, walk, tmp_path):
    shifted = write_tum(tmp_path / "estimate.txt", 2 * walk + [5, 0, 0])
    out = tmp_path / "scores.json"
    result = run("sgf_eval", "trajectory", shifted, "--truth", truth, "--align", "sim3", "--out", out)
    scores = scores_of(result, out)
    assert scores["align"] == "sim3" and scores["estimate"] == str(shifted)
    assert scores["poses"] == POSES and scores["coverage_pct"] is None
    assert scores["scale"] == pytest.approx(0.5) and scores["ate_rmse_m"] < 1e-9
    assert scores["success_by_ate"] is True
    table = dict(line.split()[:2] for line in result.stdout.splitlines())
    assert table["scale"] == "0.5" and table["poses"] == str(POSES)
    assert table["rpe_one_second.stretches"] == str(scores["rpe_one_second.stretches"])


def test_the_csv_has_the_same_values(truth, walk, tmp_path):
    estimate = write_tum(tmp_path / "a,b.txt", walk + np.random.default_rng(1).normal(0, 0.1, walk.shape))
    for name in ("scores.json", "scores.csv"):
        arguments = ["trajectory", estimate, "--truth", truth, "--out", tmp_path / name]
        assert run("sgf_eval", *arguments).returncode == 0
    scores = json.loads((tmp_path / "scores.json").read_text())
    header, line = (tmp_path / "scores.csv").read_text().splitlines()
    assert line.startswith(f'"{estimate}","{truth}"')
    names, values = header.split(","), line.replace("a,b", "a;b").split(",")
    row = dict(zip(names, values, strict=True))
    assert float(row["ate_rmse_m"]) == scores["ate_rmse_m"] > 0.05
    assert row["success_by_ate"] == str(scores["success_by_ate"]).lower()
    assert row["coverage_pct"] == "nan"


@pytest.fixture
def kitti(walk, tmp_path):
    """A sequence of KITTI's layout whose truth is the walk."""
    from PIL import Image

    folder = tmp_path / "dataset/sequences/07"
    for eye in ("image_0", "image_1"):
        (folder / eye).mkdir(parents=True)
        for i in range(POSES):
            Image.fromarray(np.zeros((2, 3), np.uint8)).save(folder / eye / f"{i:06}.png")
    (folder / "calib.txt").write_text(
        "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP1: 700 0 600 -350 0 700 180 0 0 0 1 0\n"
    )
    (folder / "times.txt").write_text("".join(f"{100 + 0.05 * i:.6e}\n" for i in range(POSES)))
    poses = tmp_path / "dataset/poses/07.txt"
    poses.parent.mkdir()
    poses.write_text("".join(f"1 0 0 {x} 0 1 0 {y} 0 0 1 {z}\n" for x, y, z in walk))
    return folder


def test_a_sequence_tells_how_many_frames_have_a_pose(kitti, walk, tmp_path):
    estimate = write_tum(tmp_path / "estimate.txt", walk[:45])
    out = tmp_path / "scores.json"
    result = run("sgf_eval", "trajectory", estimate, "--sequence", kitti, "--out", out)
    scores = scores_of(result, out)
    assert (scores["frames"], scores["poses"], scores["coverage_pct"]) == (POSES, 45, 75)
    assert scores["ate_max_m"] < 1e-9 and scores["frame"] == "body"


def test_estimates_are_compared_over_the_poses_that_all_have(kitti, walk, tmp_path):
    bad_end = walk.copy()
    bad_end[45:] += 3
    estimate = write_tum(tmp_path / "estimate.txt", bad_end)
    other = write_tum(tmp_path / "other.txt", walk[:45])
    out = tmp_path / "scores.json"
    arguments = ["trajectory", estimate, "--sequence", kitti, "--out", out]
    assert scores_of(run("sgf_eval", *arguments), out)["ate_rmse_m"] > 0.5
    scores = scores_of(run("sgf_eval", *arguments, "--common", other), out)
    assert scores["ate_rmse_m"] < 1e-9
    assert (scores["poses"], scores["coverage_pct"]) == (45, 100)


def test_an_estimate_without_poses_has_no_errors_and_no_success(kitti, tmp_path):
    estimate = write_tum(tmp_path / "estimate.txt", [])
    out = tmp_path / "scores.json"
    result = run("sgf_eval", "trajectory", estimate, "--sequence", kitti, "--out", out)
    scores = scores_of(result, out)
    assert scores["coverage_pct"] == 0 and scores["ate_rmse_m"] is None
    assert scores["success_by_ate"] is False


def test_the_estimate_and_its_points_are_moved_to_the_ground_truth(truth, walk, tmp_path):
    estimate = write_tum(tmp_path / "estimate.txt", 2 * walk + [5, 0, 0])
    points = write_points(tmp_path / "points.ply", [(7, 2, 4, 0.5, 99, 3), (5, 0, 0, 0.25, 1, 2)])
    score = ["sgf_eval", "trajectory", estimate, "--truth", truth, "--align", "sim3"]
    poses, moved = tmp_path / "aligned.txt", tmp_path / "moved.ply"
    result = run(*score, "--aligned", poses, "--points", points, "--aligned-points", moved)
    assert result.returncode == 0, result.stderr
    assert np.allclose(np.loadtxt(poses)[:, 1:4], walk, atol=1e-9)
    expected = [(1, 1, 2, 0.5, 99, 3), (0, 0, 0, 0.25, 1, 2)]
    assert np.allclose(read_points(moved), expected, atol=1e-6)
    write_tum(estimate, walk[:2])
    assert run(*score, "--aligned", poses, "--points", points, "--aligned-points", moved).returncode == 0
    assert read_points(moved) == []
    assert all(line.startswith("#") for line in poses.read_text().splitlines())
    points.write_text("ply\n")
    assert fails(run(*score, "--points", points, "--aligned-points", moved), "points.ply", "header")
    assert run(*score, "--points", points).returncode == 2


def test_bad_input_is_named(kitti, truth, tmp_path):
    score = ["sgf_eval", "trajectory"]
    assert fails(run(*score, tmp_path / "none.txt", "--truth", truth), "none.txt")
    (tmp_path / "bad.txt").write_text("1 2 3\n")
    assert fails(run(*score, tmp_path / "bad.txt", "--truth", truth), "bad.txt:1", "3 columns")
    (tmp_path / "empty.txt").write_text("#\n")
    assert fails(run(*score, truth, "--truth", tmp_path / "empty.txt"), "empty.txt: has no poses")
    assert fails(run(*score, truth, "--truth", truth, "--align", "so3"), "so3", "none, se3, sim3")
    assert fails(run(*score, truth, "--truth", truth, "--frame", "body"), "--frame")
    (tmp_path / "dataset/poses/07.txt").unlink()
    assert fails(run(*score, truth, "--sequence", kitti), "07: has no ground truth")
    for arguments in ([truth], [truth, "--truth", truth, "--sequence", kitti]):
        assert run(*score, *arguments).returncode == 2
