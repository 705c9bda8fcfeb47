"""sgf_stereo and sgf_eval from the command line."""

import json
import os
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

BUILD = Path(os.environ["SGF_BUILD_DIR"])
SHIFT = 6
SIZE = (60, 100)  # rows, columns
METHODS = ["bm", "mesh", "sgm", "opencv_bm", "opencv_sgbm"]


def run(program, *arguments):
    command = [BUILD / "bin" / program, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def write_pfm(path, values):
    rows, columns = values.shape
    data = np.flipud(values).astype("<f4").tobytes()
    path.write_bytes(f"Pf\n{columns} {rows}\n-1\n".encode() + data)


def read_pfm(path):
    kind, size, scale, data = path.read_bytes().split(b"\n", 3)
    assert kind == b"Pf" and float(scale) < 0
    columns, rows = map(int, size.split())
    return np.flipud(np.frombuffer(data, "<f4").reshape(rows, columns))


def read_points(path):
    """Points as rows x, y, z, variance, grey and support."""
    header, _, body = path.read_bytes().partition(b"end_header\n")
    assert f"element vertex {len(body) // 23}\n".encode() in header
    return [(*p[:5], p[7]) for p in struct.iter_unpack("<4f3Bi", body)]


def write_points(path, points):
    kinds = ["float x", "float y", "float z", "float variance"]
    kinds += ["uchar red", "uchar green", "uchar blue", "int support"]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    lines += [*(f"property {kind}" for kind in kinds), "end_header", ""]
    body = b"".join(struct.pack("<4f3Bi", *p[:4], p[4], p[4], p[4], p[5]) for p in points)
    path.write_bytes("\n".join(lines).encode() + body)
    return path


@pytest.fixture
def scene(tmp_path):
    """A scene of Middlebury's layout at a disparity of SHIFT px, in a dataset of its own."""
    folder = tmp_path / "dataset" / "Wall"
    folder.mkdir(parents=True)
    texture = np.random.default_rng(1).integers(0, 256, (SIZE[0], SIZE[1] + SHIFT), np.uint8)
    Image.fromarray(texture[:, : SIZE[1]]).save(folder / "im0.png")
    Image.fromarray(texture[:, SHIFT:]).save(folder / "im1.png")
    write_pfm(folder / "disp0GT.pfm", np.full(SIZE, SHIFT, np.float32))
    (folder / "calib.txt").write_text("ndisp=16\n")
    return folder


@pytest.fixture
def pair(scene):
    return scene / "im0.png", scene / "im1.png"


def fails(result, *parts):
    """Bad input: exit code 2 and one line on stderr that holds all parts."""
    assert result.returncode == 2, result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    for part in parts:
        assert str(part) in result.stderr
    return True


def repeat(program, *inputs, flags, out):
    """Runs a program with flags, then with the options.yaml that it has left: its folders, whose options are equal."""
    first, again = out / "first", out / "again"
    for folder, options in ((first, flags), (again, ["--config", first / "options.yaml"])):
        result = run(program, *inputs, "-o", folder, *options)
        assert result.returncode == 0, result.stderr
    assert (again / "options.yaml").read_text() == (first / "options.yaml").read_text()
    return first, again


def test_a_pair_gives_disparities_pictures_and_scores(scene, pair, tmp_path):
    out = tmp_path / "out"
    result = run("sgf_stereo", *pair, "-o", out, "--gt", scene / "disp0GT.pfm", "--max-disp", 16)
    assert result.returncode == 0, result.stderr
    assert sorted(p.name for p in out.iterdir()) == [
        "colour.png", "disparity.pfm", "disparity.png", "options.yaml", "scores.json"
    ]
    disparity = read_pfm(out / "disparity.pfm")
    matched = np.isfinite(disparity)
    assert matched[:, SHIFT + 4 :].mean() > 0.99
    assert np.abs(disparity[matched] - SHIFT).mean() < 0.05
    png = np.array(Image.open(out / "disparity.png"))
    # As in KITTI, 0 means none: a disparity of 0 becomes 1.
    assert np.array_equal(png[matched], np.maximum(1, np.round(256 * disparity[matched])))
    assert (png[~matched] == 0).all()
    scores = json.loads((out / "scores.json").read_text())["all"]
    assert scores["truth_px"] == SIZE[0] * SIZE[1]
    assert scores["mean_px"] == pytest.approx(np.abs(disparity[matched] - SHIFT).mean(), abs=1e-5)
    assert Image.open(out / "colour.png").size == SIZE[::-1]


def test_a_dataset_folder_gives_a_folder_a_scene(scene, tmp_path):
    result = run("sgf_stereo", scene.parent, "-o", tmp_path / "out", "--metric", "census")
    assert result.returncode == 0, result.stderr
    assert json.loads((tmp_path / "out" / "Wall" / "scores.json").read_text())["all"]["bad1_pct"] < 1


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_wall_and_prints_all_its_options(scene, pair, tmp_path, method):
    out = tmp_path / "out"
    flags = ["--method", method, "--window", 11, "--max-disp", 16, "--gt", scene / "disp0GT.pfm"]
    result = run("sgf_stereo", *pair, "-o", out, *flags)
    assert result.returncode == 0, result.stderr
    scores = json.loads((out / "scores.json").read_text())["all"]
    assert scores["bad1_pct"] < 2 and scores["invalid_pct"] < 40
    options = (out / "options.yaml").read_text()
    assert f"method: {method}\n" in options
    assert ("block_size: 11" if method.startswith("opencv") else "window: 11") in options
    assert ("random_trials" if method == "mesh" else "uniqueness") in options


@pytest.mark.parametrize("method", METHODS)
def test_colour_images_are_taken_by_every_method(pair, tmp_path, method):
    for image in pair:
        grey = np.array(Image.open(image))
        Image.fromarray(np.stack([grey, grey // 2, 255 - grey], axis=2)).save(image)
    result = run("sgf_stereo", *pair, "-o", tmp_path / "out", "--method", method, "--max-disp", 16)
    assert result.returncode == 0, result.stderr
    disparity = read_pfm(tmp_path / "out" / "disparity.pfm")[:, 16:]
    assert np.median(disparity[np.isfinite(disparity)]) == pytest.approx(SHIFT, abs=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_fill_leaves_no_hole(pair, tmp_path, method):
    flags = ["--method", method, "--max-disp", 16]
    assert run("sgf_stereo", *pair, "-o", tmp_path / "plain", *flags).returncode == 0
    assert run("sgf_stereo", *pair, "-o", tmp_path / "filled", *flags, "--fill").returncode == 0
    plain, filled = (read_pfm(tmp_path / name / "disparity.pfm") for name in ("plain", "filled"))
    found = np.isfinite(plain)
    assert np.isfinite(filled).all() and np.array_equal(filled[found], plain[found])
    assert found.all() == (method == "mesh")
    assert "fill: true" in (tmp_path / "filled" / "options.yaml").read_text()


def test_mesh_writes_its_mesh_and_what_the_right_image_confirms(pair, tmp_path):
    out = tmp_path / "out"
    assert run("sgf_stereo", *pair, "-o", out, "--method", "mesh", "--max-disp", 16).returncode == 0
    header = (out / "mesh.ply").read_bytes().split(b"end_header\n")[0].decode()
    assert header.startswith("ply\n") and "element vertex" in header and "element face" in header
    valid = np.array(Image.open(out / "valid.png"))
    assert valid.shape == SIZE and set(np.unique(valid)) <= {0, 255}
    assert (valid[:, SHIFT:] == 255).mean() > 0.9


def defined(result, folder):
    """A disparity map, or bad input named: exit code 2 and one line."""
    if result.returncode == 2:
        return len(result.stderr.strip().splitlines()) == 1
    assert result.returncode == 0, result.stderr
    disparity = read_pfm(folder / "disparity.pfm")
    return ((disparity > -1) | ~np.isfinite(disparity)).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rows, columns", [(1, 1), (2, 3), (7, 9), (40, 60)])
def test_textureless_and_tiny_images_give_a_result_or_an_error(tmp_path, method, rows, columns):
    image = tmp_path / "flat.png"
    Image.fromarray(np.full((rows, columns), 77, np.uint8)).save(image)
    for count in (1, min(16, columns)):
        out = tmp_path / f"out{count}"
        flags = ["--method", method, "--max-disp", count, "--window", 5]
        assert defined(run("sgf_stereo", image, image, "-o", out, *flags), out)


@pytest.mark.parametrize("method", METHODS)
def test_one_disparity_is_searched(pair, tmp_path, method):
    out = tmp_path / "out"
    flags = ["--method", method, "--max-disp", 1, "--min-disparity", SHIFT]
    result = run("sgf_stereo", *pair, "-o", out, *flags)
    assert result.returncode == 0, result.stderr
    disparity = read_pfm(out / "disparity.pfm")
    if not method.startswith("opencv"):  # which rounds up to 16
        assert set(np.unique(disparity[np.isfinite(disparity)])) == {SHIFT}


def test_instruction_sets_and_threads_give_the_same_file(pair, tmp_path):
    files = []
    for name, flags in {"a": [], "b": ["--isa", "scalar"], "c": ["--threads", 1]}.items():
        assert run("sgf_stereo", *pair, "-o", tmp_path / name, *flags).returncode == 0
        files.append((tmp_path / name / "disparity.pfm").read_bytes())
    assert files[0] == files[1] == files[2]


def test_flags_come_on_top_of_the_options_file(pair, tmp_path):
    config = tmp_path / "run.yaml"
    config.write_text("window: 5\nmetric: pm\n")
    run("sgf_stereo", *pair, "-o", tmp_path / "out", "--config", config, "--window", 7)
    options = (tmp_path / "out" / "options.yaml").read_text()
    assert "window: 7" in options and "metric: pm" in options


@pytest.mark.parametrize("method", METHODS)
def test_a_run_is_repeated_by_its_options(pair, tmp_path, method):
    flags = ["--method", method, "--fill", "--max-disp", 9, "--window", 7, "--threads", 1]
    if method == "bm":
        flags += ["--metric", "pm", "--pm.alpha", "0.3", "--epsilon.scope", "window"]
    first, again = repeat("sgf_stereo", *pair, flags=flags, out=tmp_path)
    assert (again / "disparity.pfm").read_bytes() == (first / "disparity.pfm").read_bytes()


def test_flags_come_on_top_of_the_options_of_a_run(pair, tmp_path):
    run("sgf_stereo", *pair, "-o", tmp_path / "out", "--fill", "--max-disp", 16)
    saved = tmp_path / "out" / "options.yaml"
    more = ["--config", saved, "--fill=false", "--window", 7]
    assert run("sgf_stereo", *pair, "-o", tmp_path / "more", *more).returncode == 0
    options = (tmp_path / "more" / "options.yaml").read_text()
    assert options == saved.read_text().replace("fill: true", "fill: false").replace("  window: 9", "  window: 7")
    more = ["--config", saved, "--method", "opencv_bm"]
    assert fails(run("sgf_stereo", *pair, "-o", tmp_path / "other", *more), "is not an option of opencv_bm")


def test_what_a_run_cannot_have_said_is_named(pair, tmp_path):
    config = tmp_path / "run.yaml"
    for text, parts in {
        "options: {window: 5}\nfil: true\n": [f"{config}:2", "unknown key 'fil'"],
        "options:\n  windwo: 5\n": [f"{config}:2", "unknown key 'windwo'"],
        "options: {window: 5}\nfill: much\n": [f"{config}:2", "fill"],
        "options: {window: 5}\nmethod: magic\n": ["magic", "bm, mesh"],
        "options: 5\n": [f"{config}:1", "map of options"],
    }.items():
        config.write_text(text)
        assert fails(run("sgf_stereo", *pair, "-o", tmp_path / "out", "--config", config), *parts)
    assert fails(run("sgf_align", tmp_path, "-o", tmp_path / "out", "--config", config), f"{config}:1")


def test_list_metrics_prints_the_table():
    result = run("sgf_stereo", "--list-metrics")
    assert result.returncode == 0
    names = [line.split()[0] for line in result.stdout.splitlines()[1:]]
    assert {"photo", "sad", "agm", "pm", "sgf", "sgf2", "sgf3", "ugf", "zncc", "census"} <= set(names)


def test_bad_images_are_named(scene, pair, tmp_path):
    out = tmp_path / "out"
    missing = tmp_path / "missing.png"
    assert fails(run("sgf_stereo", missing, pair[1], "-o", out), missing)
    cut = tmp_path / "cut.png"
    cut.write_bytes(pair[0].read_bytes()[:-300])
    assert fails(run("sgf_stereo", cut, pair[1], "-o", out), cut)
    small = tmp_path / "small.png"
    Image.fromarray(np.zeros((30, 50), np.uint8)).save(small)
    for method in METHODS:
        result = run("sgf_stereo", pair[0], small, "-o", out, "--method", method)
        assert fails(result, "50x30", "100x60")
    flags = ["-o", out, "--window", 31, "--max-disp", 16]
    assert fails(run("sgf_stereo", small, small, *flags), "window", "31", "50x30")
    assert not out.exists()


def test_bad_truth_is_named_and_leaves_nothing_behind(pair, tmp_path):
    out = tmp_path / "out"
    other_size = tmp_path / "other.pfm"
    write_pfm(other_size, np.zeros((5, 5), np.float32))
    assert fails(run("sgf_stereo", *pair, "-o", out, "--gt", other_size), "5x5", "100x60")
    cut = tmp_path / "cut.pfm"
    cut.write_bytes(other_size.read_bytes()[:-7])
    assert fails(run("sgf_stereo", *pair, "-o", out, "--gt", cut), cut)
    assert not out.exists()


@pytest.mark.parametrize(
    "flags, parts",
    [
        (["--metric", "sfg"], ["sfg", "sgf3"]),
        (["--metric", "lssd"], ["lssd"]),
        (["--max-disp", "0"], ["num_disparities", "0"]),
        (["--max-disp", "3000"], ["num_disparities", "3000"]),
        (["--max-disp", "101"], ["num_disparities", "101", "100"]),
        (["--window", "8"], ["window", "8"]),
        (["--window", "wide"], ["window", "wide"]),
        (["--uniqueness", "-1"], ["uniqueness", "-1"]),
        (["--method", "magic"], ["magic", "bm, mesh, sgm, opencv_bm, opencv_sgbm"]),
        (["--isa", "mmx"], ["mmx"]),
        (["--method", "opencv_bm", "--uniqueness", "-3"], ["uniqueness", "-3"]),
        (["--method", "opencv_bm", "--uniqueness", "2.5"], ["uniqueness", "2.5"]),
        (["--method", "opencv_bm", "--window", "257"], ["window", "257"]),
        (["--method", "opencv_bm", "--max-disp", "0"], ["num_disparities", "0"]),
        (["--method", "opencv_bm", "--metric", "sgf"], ["metric", "opencv_bm"]),
        (["--method", "opencv_bm", "--window", "61"], ["window", "61", "100x60"]),
        (["--method", "opencv_sgbm", "--window", "4"], ["window", "4"]),
        (["--method", "opencv_sgbm", "--p1", "4"], ["p1", "opencv_sgbm"]),
        (["--method", "bm", "--p1", "4"], ["p1", "bm"]),
        (["--method", "mesh", "--uniqueness", "5"], ["uniqueness_pct", "mesh"]),
        (["--method", "mesh", "--window", "8"], ["window", "8"]),
        (["--method", "sgm", "--texture-threshold", "5"], ["texture_threshold", "sgm"]),
        (["--method", "sgm", "--p1", "125"], ["p1", "125"]),
        (["--method", "sgm", "--max-disp", "101"], ["num_disparities", "101", "100"]),
        (["--method", "mesh", "--max-disp", "101"], ["num_disparities", "101", "100"]),
        (["--layout", "kitti2015"], ["--layout"]),
        (["--gt-scale", "4"], ["--gt-scale"]),
    ],
)
def test_bad_options_are_named(pair, tmp_path, flags, parts):
    assert fails(run("sgf_stereo", *pair, "-o", tmp_path / "out", *flags), *parts)
    assert not (tmp_path / "out").exists()


def test_an_unknown_key_is_named_with_file_and_line(pair, tmp_path):
    config = tmp_path / "run.yaml"
    config.write_text("window: 5\nwindwo: 7\n")
    result = run("sgf_stereo", *pair, "-o", tmp_path / "out", "--config", config)
    assert fails(result, f"{config}:2", "windwo")


def test_a_file_with_an_option_of_another_method_is_an_error(pair, tmp_path):
    config = tmp_path / "run.yaml"
    config.write_text("p1: 5\n")
    flags = ["-o", tmp_path / "out", "--config", config]
    assert run("sgf_stereo", *pair, *flags, "--method", "sgm").returncode == 0
    assert fails(run("sgf_stereo", *pair, *flags, "--method", "bm"), "p1", "bm")


def test_bad_datasets_are_named(scene, tmp_path):
    out = tmp_path / "out"
    missing = tmp_path / "nothing"
    assert fails(run("sgf_stereo", missing, "-o", out), missing)
    (scene / "calib.txt").write_text("width=100\n")
    assert fails(run("sgf_stereo", scene.parent, "-o", out), scene / "calib.txt", "ndisp")
    assert not out.exists()


def test_flags_that_would_have_no_effect_on_a_folder_are_errors(scene, tmp_path):
    truth = scene / "disp0GT.pfm"
    assert fails(run("sgf_stereo", scene.parent, "-o", tmp_path / "out", "--gt", truth), "--gt")
    run("sgf_stereo", scene.parent, "-o", tmp_path / "out", "--max-disp", 9)
    assert "num_disparities: 9" in (tmp_path / "out" / "Wall" / "options.yaml").read_text()


def test_an_output_that_is_a_file_is_an_error(pair, tmp_path):
    (tmp_path / "out").write_text("kept")
    assert fails(run("sgf_stereo", *pair, "-o", tmp_path / "out"), tmp_path / "out")
    assert (tmp_path / "out").read_text() == "kept"


def test_a_wrong_command_line_ends_with_2(pair):
    for arguments in ([], [pair[0]], [*pair], [*pair, "--frobnicate"]):
        assert run("sgf_stereo", *arguments).returncode == 2
    assert run("sgf_eval").returncode == 2
    assert run("sgf_stereo", "--help").returncode == 0


@pytest.fixture
def sweep(scene, tmp_path):
    """Arguments of `sgf_eval stereo` for a sweep over the one scene."""
    (tmp_path / "layouts.yaml").write_text(
        "walls: {title: Walls, layout: middlebury_eval3, folders: [dataset]}\n"
    )
    (tmp_path / "sweep.yaml").write_text(
        "name: test\nmatcher: stereo_bm\ncolumns:\n  sgf: {options: {metric: sgf}}\n"
        "  orig: {implementation: opencv_bm}\n  sgm: {implementation: sgm}\n"
        "  mesh: {implementation: mesh}\n  sgbm: {implementation: opencv_sgbm}\n"
        "  filled: {implementation: sgm, fill: true}\n"
        "options: {left_right_max: 2}\ngrid: {windows: [5, 9], uniqueness: [0, 15]}\n"
    )
    return [
        "stereo", "--experiment", tmp_path / "sweep.yaml", "--layouts", tmp_path / "layouts.yaml",
        "--data", tmp_path, "--dataset", "walls", "--out", tmp_path / "raw.csv",
    ]


@pytest.mark.parametrize("column", ["sgf", "orig", "sgm", "sgbm", "filled"])
def test_a_sweep_scores_every_window_and_threshold(sweep, tmp_path, column):
    result = run("sgf_eval", *sweep, "--column", column, "--options-out", tmp_path / "options.yaml")
    assert result.returncode == 0, result.stderr
    header, *lines = (tmp_path / "raw.csv").read_text().splitlines()
    rows = [dict(zip(header.split(","), line.split(","))) for line in lines]
    assert [(row["window"], row["uniqueness"]) for row in rows] == [
        ("5", "0"), ("5", "15"), ("9", "0"), ("9", "15")
    ]
    assert all(row["scene"] == "Wall" and row["region"] == "all" for row in rows)
    assert all(float(row["mean_px"]) < 0.1 for row in rows)
    assert all((float(row["invalid_pct"]) == 0) == (column == "filled") for row in rows)
    options = (tmp_path / "options.yaml").read_text()
    assert f"fill: {str(column == 'filled').lower()}" in options
    assert ("left_right_max: 2" in options) == (column not in ("orig", "sgbm"))


def test_a_dense_method_is_swept_over_windows_only(sweep, tmp_path):
    assert fails(run("sgf_eval", *sweep, "--column", "mesh"), "uniqueness", "15")
    file = tmp_path / "sweep.yaml"
    file.write_text(file.read_text().replace("[0, 15]", "[0]"))
    result = run("sgf_eval", *sweep, "--column", "mesh")
    assert result.returncode == 0, result.stderr
    assert len((tmp_path / "raw.csv").read_text().splitlines()) == 1 + 2


def test_bad_sweeps_are_named(sweep, tmp_path):
    assert fails(run("sgf_eval", *sweep, "--column", "agm"), "sweep.yaml", "agm")
    file = tmp_path / "sweep.yaml"
    file.write_text(file.read_text().replace("metric: sgf", "metrik: sgf"))
    assert fails(run("sgf_eval", *sweep, "--column", "sgf"), f"{file}:4", "metrik")
    file.write_text(file.read_text().replace("opencv_sgbm", "opencv_magic"))
    assert fails(run("sgf_eval", *sweep, "--column", "sgbm"), "opencv_magic", "opencv_bm")
    file.write_text(file.read_text().replace("matcher: stereo_bm", "matcher: {}"))
    assert fails(run("sgf_eval", *sweep, "--column", "orig"), f"{file}:2")
    assert fails(run("sgf_eval", *sweep[:-4], "--dataset", "bridges", "--out", "x", "--column", "sgf"), "bridges")
    assert not (tmp_path / "raw.csv").exists()


def test_the_build_is_told_with_its_instruction_set():
    result = run("sgf_eval", "build")
    told = dict(line.split(": ", 1) for line in result.stdout.splitlines())
    assert result.returncode == 0 and list(told) == ["version", "revision", "compiler", "type", "simd"]
    assert told["simd"] and told["compiler"].split()[0] in ("GNU", "Clang")


def test_a_change_is_made_to_the_right_images(sweep, tmp_path):
    changes = tmp_path / "changes.yaml"
    changes.write_text("changes:\n  dark: {exposure: 0.001}\n")
    options = tmp_path / "options.yaml"
    more = ["--column", "sgf", "--changes", changes, "--change", "dark", "--window", 9]
    result = run("sgf_eval", *sweep, *more, "--options-out", options)
    assert result.returncode == 0, result.stderr
    header, *lines = (tmp_path / "raw.csv").read_text().splitlines()
    rows = [dict(zip(header.split(","), line.split(","))) for line in lines]
    assert [(row["window"], row["uniqueness"]) for row in rows] == [("9", "0"), ("9", "15")]
    assert all(float(row["mean_px"]) == SHIFT for row in rows), "on a black image the first disparity wins"
    assert "exposure: 0.001" in options.read_text()
    result = run("sgf_eval", *sweep, "--column", "sgf", "--change", "dark")
    assert result.returncode == 2 and "--changes" in result.stderr
