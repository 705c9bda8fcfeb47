"""Fig. 2: colours of gradients, and what is drawn where."""

import numpy as np
import pytest
from PIL import Image

from sgf_paper import config, shift_profile


def write_pfm(path, values):
    header = f"Pf\n{values.shape[1]} {values.shape[0]}\n-1\n".encode()
    path.write_bytes(header + values[::-1].astype("<f4").tobytes())


@pytest.fixture
def raw(tmp_path):
    """What sgf_study writes: a least error of 1 at shift -80 and a second minimum at 0."""
    figure = config.load_experiment("fig2")
    profiles, minima = "row,metric,shift_px,error\n", "row,metric,shift_px,error,least\n"
    for row in ("noise_free", "noisy"):
        for metric in figure.study["profile"]["metrics"]:
            for shift in range(-110, 110):
                error = {-80: 1, 0: 2}.get(shift, 5)
                profiles += f"{row},{metric},{shift},{error}\n"
            minima += f"{row},{metric},-80,1,1\n{row},{metric},0,2,0\n"
        Image.fromarray(np.zeros((96, 240), dtype=np.uint8)).save(tmp_path / f"{row}.png")
        for axis in ("ax", "ay"):
            write_pfm(tmp_path / f"{row}_{axis}.pfm", np.zeros((96, 240)))
    (tmp_path / "profiles.csv").write_text(profiles)
    (tmp_path / "minima.csv").write_text(minima)
    return tmp_path


def test_hue_is_the_direction_and_brightness_the_length():
    ax, ay = np.array([[1.0, 0.5, 0.0, -1.0]]), np.array([[0.0, 0.0, 0.0, 0.0]])
    colours = shift_profile.gradient_colours(ax, ay)[0]
    np.testing.assert_allclose(colours[0], [1, 0, 0])
    np.testing.assert_allclose(colours[1], [0.5, 0, 0])
    np.testing.assert_allclose(colours[2], [0, 0, 0])
    np.testing.assert_allclose(colours[3], [0, 1, 1], atol=1e-12)  # the opposite: the other hue


def test_profiles_and_minima_stand_below_the_edges_they_belong_to(raw):
    drawing = shift_profile.draw(config.load_experiment("fig2"), raw)
    axes = np.array(drawing.axes).reshape(6, 2)
    assert [axis.get_title() for axis in axes[0]] == ["noise-free", "noisy"]
    patch = axes[0][0].patches[0]
    assert patch.get_x() + patch.get_width() / 2 == 120
    assert patch.get_y() + patch.get_height() / 2 == 48
    truth, curve, *circles = axes[4][1].get_lines()
    assert list(truth.get_xdata()) == [120, 120]
    assert curve.get_xdata()[0] == 10 and curve.get_ydata()[120 - 80 - 10] == 1
    assert [(c.get_xdata()[0], c.get_ydata()[0]) for c in circles] == [(40, 1), (120, 2)]
    assert [c.get_markerfacecolor() for c in circles] == [shift_profile.GREEN, "none"]


def test_tables_are_what_was_measured(raw, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    shift_profile.make_figure("fig2", raw, out, out)
    assert (out / "fig2.csv").read_text() == (raw / "profiles.csv").read_text()
    assert (out / "fig2_minima.csv").read_text() == (raw / "minima.csv").read_text()
    assert (out / "fig2.png").stat().st_size > 5000 and (out / "fig2.pdf").stat().st_size > 2000
