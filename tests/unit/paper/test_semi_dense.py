"""Figure 3: reading of points, their views and colours, and what is written below them."""

import numpy as np
import pandas as pd
import pytest
import yaml

from sgf_paper import config, semi_dense_figure, summary
from sgf_paper.semi_dense_figure import Frame, PlyError
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.study_config import SemiDenseRow

HEADER = (
    "ply\nformat binary_little_endian 1.0\nelement vertex {}\n"
    "property float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    "property float depth_error\nend_header\n"
)
VERTEX = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1"),
          ("depth_error", "<f4")]  # fmt: skip
TOP_ERROR = SemiDenseRow("t", "search", "top", "error")
TOP_GREY = SemiDenseRow("t", "search", "top", "grey")
FIGURE = {
    "kind": "semi_dense",
    "name": "toy",
    "title": "A toy",
    "pair": "pairs/toy",
    "study": {"min_gradient": 5, "min_epipolar_gradient": 2, "bad_pct": 5},
    "cases": {"search": {}, "checked": {}},
    "rows": [
        {"title": "one", "case": "search", "view": "side", "colour": "grey"},
        {"title": "two", "case": "search", "view": "top", "colour": "error"},
        {"title": "three", "case": "checked", "view": "top", "colour": "error"},
    ],
    "columns": {
        "ugf": {"options": {"metric": "ugf"}},
        "sgf": {"options": {"metric": "sgf"}},
        "pm": {"options": {"metric": "pm"}, "extra": True},
    },
}
SCORES = {
    "pair": "toy", "candidates": 40, "kept": 20, "kept_pct": 50.0, "median_m": 0.0123,
    "p90_m": 0.25, "median_pct": 1.5, "p90_pct": 9.25, "bad_pct": 12.5, "bad_stronger_pct": 75.0,
}  # fmt: skip


def points(*vertices):
    """Points of (x, y, z, grey, depth error)."""
    rows = [(x, y, z, grey, grey, grey, error) for x, y, z, grey, error in vertices]
    return np.array(rows, dtype=VERTEX)


def wall(depth):
    grid = np.mgrid[-1:1:21j, -1:1:21j].reshape(2, -1).T
    return points(*((x, y, depth + 0.2 * x, 90, 0.0) for x, y in grid))


def write_ply(path, cloud):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(HEADER.format(len(cloud)).encode() + cloud.tobytes())


@pytest.fixture
def figure(experiments):
    (experiments / "toy.yaml").write_text(yaml.safe_dump(FIGURE, sort_keys=False))
    return config.load_experiment("toy")


@pytest.fixture
def raw(tmp_path):
    """What `sgf_study semi-dense` leaves."""
    folder = tmp_path / "raw"
    write_ply(folder / "truth.ply", wall(4))
    rows = []
    for case in FIGURE["cases"]:
        for column, node in FIGURE["columns"].items():
            rows.append({**SCORES, "case": case, "column": column})
            if "extra" not in node:
                write_ply(folder / case / f"{column}.ply", wall(4.1))
    pd.DataFrame(rows).to_csv(folder / "scores.csv", index=False)
    return folder


def test_points_are_read_as_they_were_written(tmp_path):
    cloud = points((1, -2, 0.5, 200, -0.25), (0, 0, 3, 0, 1.5))
    write_ply(tmp_path / "a.ply", cloud)
    read = semi_dense_figure.read_ply(tmp_path / "a.ply")
    assert read.dtype.names == cloud.dtype.names
    np.testing.assert_array_equal(read, cloud)


@pytest.mark.parametrize(
    "data, message",
    [
        (b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "not a binary little-endian"),
        (b"P5 1 1 255\n0", "not a binary little-endian"),
        (HEADER.format(2).encode() + bytes(19), "19 bytes do not hold 2 points"),
    ],
)
def test_files_that_hold_no_points_are_named(tmp_path, data, message):
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.raises(PlyError, match=f"a.ply: {message}"):
        semi_dense_figure.read_ply(tmp_path / "a.ply")


def drawn(image):
    """Row, column and colour of the pixels that are not white."""
    rows, columns = np.nonzero((image < 1).any(axis=2))
    return [(r, c, tuple(image[r, c])) for r, c in zip(rows, columns)]


def test_the_view_from_above_has_depth_upwards():
    frame = Frame(np.array([-1.0, -4.0]), np.array([1.0, 0.0]))
    rows, columns = frame.shape
    image = semi_dense_figure.render(points((0.5, 0, 1, 200, 0)), TOP_GREY, frame)
    ((row, column, _),) = drawn(image)
    assert (row, column) == (rows * 3 // 4, columns * 3 // 4)


def test_what_is_above_covers_what_is_below_and_the_frame_cuts():
    frame = Frame(np.array([-1.0, -4.0]), np.array([1.0, 0.0]))
    cloud = points((0, 0.5, 2, 200, 0), (0, -0.5, 2, 100, 0), (0, 0, 2, 0, 0), (9, 0, 2, 0, 0))
    ((_, _, colour),) = drawn(semi_dense_figure.render(cloud, TOP_GREY, frame))
    assert colour == pytest.approx([0.85 * 100 / 255] * 3)


def test_the_side_view_moves_what_is_far_to_the_left():
    near, far = semi_dense_figure._seen(points((0, 0, 1, 0, 0), (0, 0, 5, 0, 0)), "side")
    assert far[0] < near[0] and far[1] < near[1] and far[2] > near[2]
    turn = semi_dense_figure.VIEWS["side"]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)


def test_colours_tell_the_sign_of_the_error_relative_to_the_true_depth():
    frame = Frame(np.array([-1.0, -12.0]), np.array([1.0, 0.0]))

    def colour(found, true):
        cloud = points((0, 0, found, 0, found - true))
        return drawn(semi_dense_figure.render(cloud, TOP_ERROR, frame))[0][2]

    exact, far, near = colour(5, 5), colour(5.5, 5), colour(4.5, 5)
    assert max(exact) < 0.25
    assert far[0] > 0.6 > far[2] and near[2] > 0.6 > near[0]
    assert colour(11, 10) == pytest.approx(far, abs=0.02)


def test_the_frame_holds_the_true_points_but_not_stray_ones():
    cloud = np.concatenate([wall(4), points((0, 0, 90, 0, 0))])
    frame = semi_dense_figure.frame_around(cloud, "top")
    assert frame.low[0] < -1 and frame.high[0] > 1
    assert -5 < frame.low[1] < -4.2 and frame.high[1] > -3.8


def test_the_numbers_stand_below_the_last_row_of_a_case(figure, raw):
    scores = pd.read_csv(raw / "scores.csv").set_index(["case", "column"])
    clouds = {(case, column): wall(4.1) for case in figure.cases for column in figure.drawn}
    drawing = semi_dense_figure.draw(figure, wall(4), clouds, scores)
    panels = np.array([axis for axis in drawing.axes if axis.get_images()]).reshape(3, 3)
    assert [axis.get_title() for axis in panels[0]] == ["ground truth", "ugf", "sgf"]
    assert [row[0].get_ylabel() for row in panels] == ["one", "two", "three"]
    numbers = "20 kept (50 %)\nmedian 1.2 cm, 90th 25.0 cm\noff by > 5 %: 12.5 %"
    below = [[axis.get_xlabel() for axis in row] for row in panels]
    assert below == [[""] * 3, ["40 points", numbers, numbers], ["40 points", numbers, numbers]]


def test_figure_and_tables_are_made_and_repeat_to_the_byte(figure, raw, tmp_path):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        semi_dense_figure.make_figure("toy", raw, tmp_path / folder, tmp_path / folder)
    for name in ("toy.png", "toy.pdf", "toy.csv", "toy.md"):
        first, second = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        assert first and first == second
    text = (tmp_path / "one" / "toy.md").read_text()
    assert "## checked" in text and "off by > 5 %" in text
    assert "| ugf | 20 | 50.0 | 0.0123 | 0.2500 | 1.50 | 9.25 | 12.50 | 75.0 |" in text
    assert "| pm (+) |" in text
    (line, _) = summary._semi_dense_lines(tmp_path / "one" / "toy.csv", figure.drawn)
    assert line.startswith("search") and line.endswith("sgf 50 %, 1.2 / 25.0 cm")


def test_a_bound_that_is_missing_is_named(experiments):
    (experiments / "bad.yaml").write_text(yaml.safe_dump({**FIGURE, "study": {"bad_pct": 5}}))
    with pytest.raises(ConfigError, match="bad.yaml: study: key 'min_gradient' is missing"):
        config.load_experiment("bad")


@pytest.mark.parametrize(
    "key, value", [("case", "nowhere"), ("view", "below"), ("colour", "red"), ("shape", "round")]
)
def test_rows_that_lead_nowhere_are_named(experiments, key, value):
    rows = [{**FIGURE["rows"][0], key: value}]
    (experiments / "bad.yaml").write_text(yaml.safe_dump({**FIGURE, "rows": rows}))
    with pytest.raises(ConfigError, match=rf"bad.yaml: rows\[0\]: .*{key}"):
        config.load_experiment("bad")
