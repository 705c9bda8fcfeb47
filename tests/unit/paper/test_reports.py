"""Density curves, the benchmark's report, figures' inputs and progress lines."""

import json
import math

import numpy as np
import pytest
from PIL import Image

from sgf_paper import bench, density, disparity_figure, images, progress, style
from sgf_paper.stereo_config import Column, Density, FigureScene, Parameters, load_sweep


@pytest.fixture
def panels(two_blocks, dense_sweep, write_raw, datasets):
    experiment = Density("density", "density", "Title", ["table9"], ["mean_px"], [65, 75, 95])
    write_raw(of=dense_sweep)
    rows = density.make_curves(experiment, {"table9": two_blocks}, write_raw(), datasets)
    return experiment, rows


def test_curves_use_the_tables_window_for_every_region(panels):
    _, rows = panels
    assert [[(p.dataset, p.region, p.matcher, p.window, p.scenes) for p in row] for row in rows] == [
        [("toys", "all", "stereo_bm", 9, 3)],
        [("toys", "noc", "stereo_bm", 9, 3)],
    ]
    points = rows[0][next(iter(rows[0]))]["sgf"]
    assert list(points["kept_pct"]) == [60, 70, 80]


def test_panels_that_two_tables_share_are_drawn_twice_and_listed_once(table, write_raw, datasets):
    tables = {"one": table, "two": table}
    experiment = Density("density", "density", "Title", list(tables), ["mean_px"], [65])
    rows = density.make_curves(experiment, tables, write_raw(), datasets)
    assert len(rows) == 4
    assert len(density.equal_table(rows, [65])) == 2 * 3


def test_filled_columns_have_no_curve(table, sweep, write_raw, datasets):
    raw = write_raw()
    sweep.columns["ugf"] = Column("bm", fill=True, extra=True)
    experiment = Density("density", "density", "Title", ["table9"], ["mean_px"], [65])
    rows = density.make_curves(experiment, {"table9": table}, raw, datasets)
    assert {column for row in rows for curves in row.values() for column in curves} == {"orig", "sgf"}


def test_equal_shares_are_read_off_the_curves(panels):
    experiment, rows = panels
    equal = density.equal_table(rows, experiment.kept_pct)
    sgf = equal[(equal["cost"] == "sgf") & (equal["region"] == "all")].set_index("kept_pct")
    # at window 9 the mean over scenes is 1 + 1 + 0.5/3 - uniqueness/100; 65 % kept is uniqueness 15
    assert sgf.loc[65, "mean_px"] == pytest.approx(2 + 0.5 / 3 - 0.15)
    assert math.isnan(sgf.loc[95, "mean_px"])


def test_the_curve_table_has_a_line_per_point(panels):
    _, rows = panels
    table = density.curve_table(rows)
    assert len(table) == 2 * 3 * 3
    assert list(table.columns) == density.CURVE_COLUMNS


def test_figures_repeat_to_the_byte(panels, tmp_path):
    experiment, rows = panels
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        style.save(density.draw(rows, ["ugf"], experiment), tmp_path / folder, "density")
    for name in ("density.pdf", "density.png"):
        first, second = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        assert len(first) > 1000 and first == second


def run(name, speed, kind="iteration", **more):
    base = {"name": name, "run_name": name + "/real_time", "run_type": kind, "family_index": 0}
    return {**base, "mde_per_s": speed, "peak_mib": 2.0, **more}


@pytest.fixture
def report(tmp_path):
    def write(runs):
        path = tmp_path / "bench.json"
        path.write_text(json.dumps({"context": {}, "benchmarks": runs}))
        return path

    return write


def test_the_benchmark_takes_medians_of_repetitions_and_no_aggregates(report):
    runs = [run("c/sgf_bm/avx2/1", speed) for speed in (10, 30, 100)]
    speeds = bench.read_report(report([*runs, run("c/sgf_bm/avx2/1", 9e9, "aggregate")]))
    assert speeds.to_dict("records") == [
        {"case": "c", "implementation": "sgf_bm", "isa": "avx2", "threads": 1,
         "mde_per_s": 30.0, "peak_mib": 2.0}
    ]  # fmt: skip


def test_shuffled_runs_are_listed_in_the_programs_order(report):
    runs = [run(f"c/sgf_bm/isa{i}/1", 1, family_index=i) for i in (2, 0, 1, 2)]
    assert list(bench.read_report(report(runs))["isa"]) == ["isa0", "isa1", "isa2"]


def test_ratios_stand_against_the_same_instruction_set_or_the_fastest(report):
    names = {"c/opencv_bm/avx2/1": 100, "c/opencv_bm/sse4/1": 120, "c/opencv_bm/avx2/2": 900,
             "c/sgf_bm/avx2/1": 200, "c/sgf_bm/avx3/1": 300, "c/sgf_bm/avx3/2": 570,
             "c/opencv_sgbm/own/1": 40, "c/sgf_sgm/avx3/1": 60}  # fmt: skip
    speeds = bench.read_report(report([run(name, speed) for name, speed in names.items()]))
    ratios = bench.ratios_to_opencv(speeds).set_index(["implementation", "isa"])
    assert ratios["ratio"].to_dict() == pytest.approx(
        {("sgf_bm", "avx2"): 2.0, ("sgf_bm", "avx3"): 300 / 120, ("sgf_sgm", "avx3"): 1.5}
    )
    assert ratios.loc[("sgf_sgm", "avx3"), "peer"] == "cv::StereoSGBM"
    scaling = bench.scaling(speeds).set_index("implementation")["ratio"]
    assert scaling["sgf_bm"] == pytest.approx(1.9)
    assert scaling["opencv_bm"] == pytest.approx(9.0)


@pytest.mark.parametrize(
    "runs, message",
    [
        ([], "no benchmark was run"),
        ([run("c/sgf_bm/avx2/1", 1, error_occurred=True, error_message="no pair")], "no pair"),
    ],
)
def test_a_failed_benchmark_is_an_error(report, runs, message):
    with pytest.raises(bench.BenchError, match=message):
        bench.read_report(report(runs))


@pytest.mark.parametrize("order, scale", [("<", b"-0.0039"), (">", b"1")])
def test_pfm_of_either_byte_order_is_read_top_row_first(tmp_path, order, scale):
    values = np.array([[1, 2, np.inf], [4, 5, 6]], dtype=f"{order}f4")
    path = tmp_path / "d.pfm"
    path.write_bytes(b"Pf\n3 2\n" + scale + b"\n" + values[::-1].tobytes())
    read = images.read_disparity(path)
    np.testing.assert_array_equal(read, [[1, 2, np.nan], [4, 5, 6]])


def test_kittis_png_is_scaled_and_zero_is_unknown(tmp_path):
    path = tmp_path / "d.png"
    Image.fromarray(np.array([[0, 256], [384, 65535]], dtype=np.uint16)).save(path)
    read = images.read_disparity(path)
    np.testing.assert_allclose(read, [[np.nan, 1], [1.5, 65535 / 256]])


def flags_of(command):
    return dict(zip(command[3::2], command[4::2]))


def test_the_matcher_is_called_as_the_sweep_would(tmp_path, sweep):
    (tmp_path / "calib.txt").write_text("width=9\nndisp=73\n")
    scene = FigureScene("s", "l.png", "r.png", "t.pfm", calibration="calib.txt")
    at = Parameters(9, 10)
    command = disparity_figure.matcher_command(tmp_path / "run", tmp_path, scene, sweep, "sgf", at)
    assert command[:3] == [str(tmp_path / name) for name in ("run", "l.png", "r.png")]
    assert flags_of(command) == {
        "--gt": str(tmp_path / "t.pfm"), "--method": "bm", "--max-disp": "73", "--window": "9",
        "--uniqueness": "10",
    }  # fmt: skip
    scene = FigureScene("s", "l.png", "r.png", "t.pfm", num_disparities=128)
    command = disparity_figure.matcher_command(tmp_path / "run", tmp_path, scene, sweep, "orig", at)
    flags = flags_of(command)
    assert (flags["--method"], flags["--max-disp"]) == ("opencv_bm", "128")


def test_the_matcher_is_called_without_what_a_dense_method_lacks(tmp_path, dense_sweep):
    scene = FigureScene("s", "l.png", "r.png", "t.pfm", num_disparities=128)
    at = Parameters(35, 0)
    command = disparity_figure.matcher_command(tmp_path, tmp_path, scene, dense_sweep, "sgf", at)
    assert set(flags_of(command)) == {"--gt", "--method", "--max-disp", "--window"}
    dense_sweep.columns["filled"] = Column("sgm", fill=True)
    command = disparity_figure.matcher_command(tmp_path, tmp_path, scene, dense_sweep, "filled", at)
    assert command[-1] == "--fill"


@pytest.mark.parametrize("width, grid", [(30, (2, 4)), (90, (3, 3))])
def test_wide_images_stand_above_the_matchers_rows_on_one_colour_scale(width, grid):
    truth = np.linspace(1, 40, 30 * width).reshape(30, width)
    truth[0, 0] = np.nan
    image = np.zeros((30, width), dtype=np.uint8)
    half = np.where(np.arange(width) % 2, truth, np.nan)
    maps = [half, truth + 100, truth]
    scene = disparity_figure.Scene("s", image, truth, {"A": maps, "B": maps[::-1]})
    drawing = disparity_figure.draw([scene], ["one", "two", "three"])
    panels = {axis.get_title(): axis for axis in drawing.axes if axis.get_title()}
    assert set(panels) == {
        "s, image", "ground truth", "A, one (50 % kept)", "A, two (100 % kept)",
        "A, three (100 % kept)", "B, one (100 % kept)", "B, two (100 % kept)", "B, three (50 % kept)",
    }  # fmt: skip
    cells = panels["s, image"].get_gridspec()
    assert (cells.nrows, cells.ncols) == grid
    row = [panels[f"A, {name} kept)"].get_subplotspec().rowspan.start
           for name in ("one (50 %", "two (100 %", "three (100 %")]  # fmt: skip
    assert row == [grid[0] - 2] * 3
    del panels["s, image"]
    assert {axis.get_images()[0].get_clim() for axis in panels.values()} == {(0.0, 40.0)}


def test_every_column_has_its_own_line():
    sweep = load_sweep("stereo_bm")  # of those with curves the one with most columns
    extra = [name for name in sweep.columns if name not in sweep.main_columns]
    styles = [tuple(sorted(map(str, style.line_style(c, extra).items()))) for c in sweep.columns]
    assert len(set(styles)) == len(sweep.columns)


STATS = """Job stats:
job       count    min threads    max threads
------  -------  -------------  -------------
all           1              1              1
scores        4              1              1
table         1              1              1
total         6              1              1
"""


def test_progress_counts_jobs_and_tells_the_time_left(capsys, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "time", lambda: now[0])
    follower = progress.Progress()
    follower.handle({"level": "run_info", "msg": STATS})
    follower.handle({"level": "job_info", "jobid": 7, "name": "scores", "msg": "scores one"})
    now[0] += 10
    follower.handle({"level": "job_finished", "jobid": 7})
    line = capsys.readouterr().out
    # four more jobs, taken to last 10 s each as the finished one did
    assert line.startswith("  [1/5] scores one") and "elapsed 0:10, about 0:40 left" in line


def test_a_failed_job_names_its_log_and_shows_its_end(capsys, tmp_path):
    log = tmp_path / "x.log"
    log.write_text("\n".join(f"line {i}" for i in range(30)))
    follower = progress.Progress()
    message = {"level": "job_error", "jobid": 1, "name": "scores", "log": [str(log)]}
    follower.handle({**message, "output": ["raw/x.csv"]})
    shown = capsys.readouterr().out
    assert f"FAILED scores: raw/x.csv; log: {log}" in shown
    assert "| line 29" in shown and "| line 10" not in shown


def test_clock():
    assert [progress.clock(s) for s in (0, 61.4, 3725)] == ["0:00", "1:01", "1:02:05"]
