"""sgf_render from the command line, in its quick quality, and the files it leaves."""

import resource
import subprocess

import numpy as np
import pytest
from PIL import Image

from test_tools import BUILD, fails, read_pfm, run, write_points

SMALL = ("--width", 94, "--height", 60, "--focal-px", 58)


def render(*arguments):
    return run("sgf_render", *arguments)


@pytest.fixture(scope="module")
def layers(tmp_path_factory):
    """All layers of a small view."""
    out = tmp_path_factory.mktemp("layers")
    done = render("scene", "--scene", "mocap_room_1", "--view", first_view(), *SMALL,
                  "--exr", "--preview", "--out", out)  # fmt: skip
    assert done.returncode == 0, done.stderr
    return next(out.glob("*.exr"))


def first_view():
    done = render("scenes", "--views")
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    return next(line[1] for line in lines if line[0] == "mocap_room_1")


def test_scenes_are_listed():
    done = render("scenes")
    assert done.returncode == 0
    names = [line.split()[0] for line in done.stdout.splitlines()]
    assert names == ["living_room", "machine_hall", "mocap_room_1", "mocap_room_2", "street"]


def test_scene_writes_a_picture_and_layers(layers):
    picture = np.asarray(Image.open(layers.with_suffix(".png")))
    assert picture.shape == (60, 94, 3)
    assert picture.std() > 10
    header = subprocess.run(["exrheader", layers], capture_output=True, text=True, check=True)
    for channel in ("R,", "light.ceiling.R,", "diffuse.R,", "Z,", "N.X,", "id,"):
        assert channel in header.stdout


def test_photometry_makes_camera_images_of_layers(layers, tmp_path):
    def expose(name, *arguments):
        out = tmp_path / name
        done = render("photometry", "--in", layers, "--out", out, *arguments)
        assert done.returncode == 0, done.stderr
        return np.asarray(Image.open(out)).astype(float)

    full = expose("full.png")
    half = expose("half.png", "--exposure-ms", 5)
    assert full.shape == (60, 94)
    assert half.mean() == pytest.approx(full.mean() / 2, rel=0.1)
    assert expose("dark.png", "--light", "ceiling=0").mean() < full.mean() - 1
    camera = tmp_path / "camera.yaml"
    camera.write_text("vignette: {model: polynomial, coefficients: [-0.5]}\n")
    dimmed = expose("vignette.png", "--camera", camera)
    assert dimmed[:5, :5].mean() < 0.7 * full[:5, :5].mean()


def test_photometry_refuses_bad_input(layers, tmp_path):
    out = tmp_path / "image.png"
    command = ("photometry", "--in", layers, "--out", out)
    assert fails(render(*command, "--exposure-ms", -1), "-1")
    assert fails(render(*command, "--light", "moon=1"), "moon", "ceiling")
    for setting in ("ceiling", "ceiling=-1", "ceiling=nan", "ceiling=0.5x"):
        assert fails(render(*command, "--light", setting), setting)
    for text, part in (
        ("vignette: {model: polynomial, coefficients: [-1.5]}", "vignette"),
        ("vignette: {model: polynomial, coefficients: [0.5]}", "vignette"),
        ("response: {model: table, table: [0, 0.6, 0.5, 1]}", "table"),
        ("shutter: 3", "shutter"),
    ):
        camera = tmp_path / "camera.yaml"
        camera.write_text(text + "\n")
        assert fails(render(*command, "--camera", camera), part)
    whole = layers.read_bytes()
    broken = tmp_path / "broken.exr"
    broken.write_bytes(whole[: len(whole) // 2])
    assert fails(render("photometry", "--in", broken, "--out", out), "broken.exr")
    assert fails(render("photometry", "--in", tmp_path / "none.exr", "--out", out), "none.exr")
    assert not out.exists()


def test_offsets_tell_how_far_points_lie_off_a_scene(tmp_path):
    # over the floor, and beyond the wall at x = 4
    points = write_points(tmp_path / "points.ply", [(0, 0, 0.5, 0, 0, 3), (4.25, 0, 3.2, 0, 0, 3)])
    out = tmp_path / "offsets.csv"
    command = ("offsets", "--points", points, "--out", out)
    done = render(*command, "--scene", "mocap_room_1")
    assert done.returncode == 0, done.stderr
    header, *lines = out.read_text().splitlines()
    assert header == "offset_m,x,y,z,object"
    floor, wall = (tuple(map(float, line.split(","))) for line in lines)
    assert floor[0] == pytest.approx(0.5, abs=0.05) and floor[3] == pytest.approx(0, abs=0.05)
    assert wall[:2] == pytest.approx((-0.25, 4), abs=1e-3)
    assert fails(render(*command, "--scene", "moon"), "moon", "mocap_room_1")
    points.write_text("ply\n")
    assert fails(render(*command, "--scene", "mocap_room_1"), "points.ply")


def test_pair_is_a_middlebury_scene(tmp_path):
    recipe = tmp_path / "pairs.yaml"
    recipe.write_text(
        f"pairs:\n- {{scene: mocap_room_1, view: {first_view()}, width: 94, height: 60, focal_px: 58}}\n"
    )
    out = tmp_path / "pairs"
    done = render("pair", "--recipe", recipe, "--preview", "--out", out)
    assert done.returncode == 0, done.stderr
    folder = out / f"mocap_room_1_{first_view()}"
    truth = read_pfm(folder / "disp0GT.pfm")
    assert truth.shape == (60, 94)
    assert 0 < truth.min() < truth.max() < 64
    mask = np.asarray(Image.open(folder / "mask0nocc.png"))
    assert 0.7 < (mask == 255).mean() < 1
    matched = run("sgf_stereo", folder / "im0.png", folder / "im1.png", "-o", tmp_path / "matched")
    assert matched.returncode == 0, matched.stderr

    twice = tmp_path / "twice.yaml"
    twice.write_text(recipe.read_text() + recipe.read_text().removeprefix("pairs:\n"))
    assert fails(render("pair", "--recipe", twice, "--preview", "--out", tmp_path / "t"), "two pairs")

    stamp = (folder / "im0.png").stat().st_mtime_ns
    assert render("pair", "--recipe", recipe, "--preview", "--out", out).returncode == 0
    assert (folder / "im0.png").stat().st_mtime_ns == stamp  # up to date


RECIPE = """
scene: mocap_room_1
duration_s: 2
short: {from_s: 0.5, frames: 2}
trajectory:
  knot_interval_s: 0.4
  waypoints: [[0, 0, 1.5, 0, 0, 0], [0.1, 0, 1.5, 5, 0, 0], [0.2, 0, 1.5, 10, 0, 0]]
"""


def test_sequence_is_rendered_once_and_refused_where_it_does_not_fit(tmp_path):
    recipe = tmp_path / "walk.yaml"
    recipe.write_text(RECIPE)
    out = tmp_path / "sequences"
    command = ("sequence", recipe, "--preview", "--out", out)
    assert fails(render(*command, "--limit-gb", 0.0001), "GB")
    done = render(*command)
    assert done.returncode == 0, done.stderr
    assert "GB" in done.stdout + done.stderr
    images = sorted((out / "walk" / "mav0" / "cam1" / "data").glob("*.png"))
    assert len(images) == 2  # one a second
    again = render(*command)
    assert "up to date" in again.stdout + again.stderr
    assert render("check", out / "walk").returncode == 0
    images[0].write_bytes(images[1].read_bytes())
    assert fails(render("check", out / "walk"), images[0].name)
    recipe.write_text(RECIPE + "trajektory: {}\n")
    assert fails(render(*command), "walk.yaml:", "trajektory")
    recipe.write_text(RECIPE.replace("mocap_room_1", "attic"))
    assert fails(render(*command), "attic", "living_room")


def test_a_full_disk_leaves_no_sequence(tmp_path):
    recipe = tmp_path / "walk.yaml"
    recipe.write_text(RECIPE)
    out = tmp_path / "sequences"
    command = [BUILD / "bin" / "sgf_render", "sequence", recipe, "--preview", "--out", out]

    def limit():
        # Python ignores SIGXFSZ, which the child keeps: writing fails instead of killing it.
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    done = subprocess.run(
        command, capture_output=True, text=True, preexec_fn=limit, restore_signals=False, timeout=120
    )
    assert done.returncode == 2, done.stderr
    assert "walk.partial" in done.stderr and "cannot be written" in done.stderr
    assert not any(out.iterdir())
