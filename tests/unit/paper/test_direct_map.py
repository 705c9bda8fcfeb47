"""Figure 6: which points are kept, how they are measured against the surface, and what is drawn."""

import json

import numpy as np
import pandas as pd
import pytest
import yaml
from matplotlib import pyplot

from conftest import STEP, TIMES_S, TURN, way
from sgf_paper import config, direct_map, paths, summary
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.tracking_config import OffSurface

NODE = yaml.safe_load((paths.EXPERIMENTS / "fig6.yaml").read_text())
SURFACE = OffSurface(far_m=0.1, doubled_m=[0.05, 0.3], cell_m=0.5, cell_points=20)
VERTEX = np.dtype([*((name, "<f4") for name in ("x", "y", "z", "variance")), ("support", "<i4")])
SCORES = {"path_m": 1.5, "scale": 2.0, "ate_rmse_m": 0.0123}


def write_map(path, vertices):
    kinds = {"<f4": "float", "<i4": "int"}
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    lines += [f"property {kinds[VERTEX[name].str]} {name}" for name in VERTEX.names]
    path.write_bytes("\n".join([*lines, "end_header", ""]).encode() + vertices.tobytes())


def write_offsets(path, offsets_m):
    """All nearest to the same place of one object."""
    lines = [f"{offset},0.1,0.2,0.3,1\n" for offset in offsets_m]
    path.write_text("offset_m,x,y,z,object\n" + "".join(lines))


def write_run(folder, count, surface=True):
    """So many points that are kept, and three that are not; the first half lies 20 cm in front of the surface."""
    folder.mkdir(parents=True)
    vertices = np.zeros(count + 3, VERTEX)
    vertices["x"] = np.arange(count + 3)
    vertices["support"], vertices["variance"] = 3, 0.0009
    vertices["support"][-3] = 2
    vertices["variance"][-2:] = 0.00091, np.nan
    write_map(folder / "map.ply", vertices)
    places = way(TIMES_S) @ TURN.T + STEP
    poses = [f"{t:.6f} {x} {y} {z} 0 0 0 1\n" for t, (x, y, z) in zip(TIMES_S[3:], places[3:])]
    (folder / "body.txt").write_text("# time x y z qx qy qz qw\n" + "".join(poses))
    frames = pd.DataFrame({"time_ns": np.round(TIMES_S * 1e9).astype(int)})
    frames.to_csv(folder / "frames.csv", index=False)
    counts = {"frames": 21, "posed": 18, "segments": 1, "keyframes": 4}
    (folder / "summary.json").write_text(json.dumps(counts))
    (folder / "scores.json").write_text(json.dumps(SCORES))
    if surface:
        offsets = [*([0.2] * (count // 2)), *([-0.01] * (count - count // 2)), 9, 9, 9]
        write_offsets(folder.with_name(f"{folder.name}_offsets.csv"), offsets)


@pytest.fixture
def raw(tmp_path):
    """What the programs write of a sequence whose surface is known."""
    folder = tmp_path / "raw" / "V1_02_medium"
    write_run(folder / "photo", 40)
    write_run(folder / "sgf", 30)
    return folder


def test_points_and_path_are_read_as_they_were_moved(raw, sequence):
    experiment = config.load_experiment("fig6")
    run = direct_map.read_run(raw / "photo", sequence, experiment.points)
    assert len(run.map.points) == 40 and list(run.map.points[-1]) == [39, 0, 0]
    assert run.map.truth.shape == (21, 3), "where the estimate has no pose as well"
    assert np.abs(run.map.path - run.map.truth[3:]).max() < 1e-4
    assert len(run.offsets) == 40 and run.offsets["offset_m"].max() == 0.2
    counts = {"frames": 21, "posed": 18, "keyframes": 4, "segments": 1, "points": 43, "kept": 40}
    assert run.numbers == {**counts, **SCORES}


def test_distances_are_those_to_both_sides():
    numbers = direct_map.measure_offsets(np.array([0.0, -0.01, 0.02, -0.06, 0.3, 0.31]), SURFACE)
    assert numbers["median_m"] == pytest.approx(0.04)
    assert numbers["far_pct"] == pytest.approx(100 / 3)
    assert numbers["doubled_pct"] == pytest.approx(100 / 3), "0.06 and 0.3"
    assert np.isnan([*direct_map.measure_offsets(np.array([]), SURFACE).values()]).all()


def test_only_what_is_drawn_twice_spreads():
    drifted = pd.DataFrame({"offset_m": np.full(50, 0.2), "x": 0.1, "y": 0.1, "z": 0.1, "object": 1})
    twice = drifted.assign(offset_m=np.tile([0.0, 0.2], 25), x=0.6)
    few = drifted.assign(z=-0.1)[:19]
    other = twice.assign(x=0.1, object=2)
    spreads = direct_map.cell_spreads(pd.concat([drifted, twice, few, other], ignore_index=True), SURFACE)
    assert spreads.to_dict() == pytest.approx({(1, 0, 0, 0): 0, (1, 1, 0, 0): 0.2, (2, 0, 0, 0): 0.2})


def test_spreads_are_compared_in_the_cells_that_all_columns_have(raw, sequence):
    experiment = config.load_experiment("fig6")
    runs = {
        column: direct_map.read_run(raw / column, sequence, experiment.points) for column in ("photo", "sgf")
    }
    more = runs["photo"].offsets.assign(x=5, offset_m=np.linspace(0, 9, 40))
    both = pd.concat([runs["photo"].offsets, more], ignore_index=True)
    runs["photo"] = direct_map.Run(runs["photo"].map, both, runs["photo"].numbers)
    photo, sgf = direct_map.measure(runs, SURFACE)
    assert photo["spread_m"] == sgf["spread_m"] == pytest.approx(0.21)
    assert photo["cells"] == sgf["cells"] == 1


def test_files_hold_the_table_and_four_panels_a_sequence(raw, sequence, tmp_path):
    direct_map.make_figure("fig6", {"V1_02_medium": (raw, sequence)}, tmp_path, tmp_path)
    table = pd.read_csv(tmp_path / "fig6.csv")
    assert list(table["column"]) == ["photo", "sgf"] and list(table["kept"]) == [40, 30]
    assert list(table["doubled_pct"]) == [50, 50] and list(table["spread_m"]) == [0.21, 0.21]
    text = (tmp_path / "fig6.md").read_text()
    assert "| photo | 21 | 18 | 1 | 4 | 1.5 | 12.3 | 43 | 40 |" in text
    assert "| V1_02_medium | sgf | 10.50 | 20.00 | 50.00 | 50.00 | 21.00 | 1 |" in text
    assert (tmp_path / "fig6.pdf").stat().st_size > 1000


def test_columns_are_drawn_side_by_side_on_the_same_axes(raw, sequence):
    experiment = config.load_experiment("fig6")
    runs = {
        column: direct_map.read_run(raw / column, sequence, experiment.points) for column in ("photo", "sgf")
    }
    table = pd.DataFrame(direct_map.measure(runs, SURFACE)).assign(sequence="V1_02_medium")
    drawing = direct_map.draw(experiment, {"V1_02_medium": runs}, table)
    row, _ = drawing.subfigs
    *panels, _ = row.axes  # the last is the scale of heights
    titles = [f"{column}, {view}" for view in ("from above", "from the side") for column in runs]
    assert [axis.get_title() for axis in panels] == titles
    assert panels[0].get_xlim() == panels[1].get_xlim() and panels[2].get_ylim() == panels[3].get_ylim()
    assert row._suptitle.get_text().splitlines()[1] == (
        "photo: 18 of 21 frames with pose, ATE RMSE 12 mm, 40 points, off the surface 10.5 cm (median),"
        " 20.0 cm (90th percentile), walls spread 21.0 cm"
    )
    pyplot.close(drawing)


def test_a_run_without_a_pose_has_an_empty_map(raw, sequence, tmp_path):
    lost = raw / "sgf"
    write_map(lost / "map.ply", np.zeros(0, VERTEX))
    (lost / "body.txt").write_text("# time x y z qx qy qz qw\n")
    (lost / "scores.json").write_text(json.dumps(dict.fromkeys(SCORES)))
    write_offsets(raw / "sgf_offsets.csv", [])
    direct_map.make_figure("fig6", {"V1_02_medium": (raw, sequence)}, tmp_path, tmp_path)
    photo, sgf = pd.read_csv(tmp_path / "fig6.csv").itertuples()
    assert photo.kept == 40 and photo.median_m > 0 and np.isnan(photo.spread_m)
    assert sgf.kept == 0 and np.isnan([sgf.ate_rmse_m, sgf.median_m, sgf.spread_m]).all()
    assert (tmp_path / "fig6.png").stat().st_size > 1000


def test_the_summary_tells_of_the_surface_where_it_is_known(raw, sequence, tmp_path):
    (tmp_path / "tables").mkdir()
    unknown = tmp_path / "raw" / "euroc_MH_01"
    for column in ("photo", "sgf"):
        write_run(unknown / column, 4, surface=False)
    folders = {"V1_02_medium": (raw, sequence), "euroc_MH_01": (unknown, sequence)}
    direct_map.make_figure("fig6", folders, tmp_path / "tables", tmp_path)
    _, known, other = summary.stage_lines(config.load_experiment("fig6"), tmp_path, 0)
    assert known.strip() == (
        "V1_02_medium, ATE RMSE, median off the surface, spread of walls:"
        " photo 12.3 mm, 10.5 cm, 21.0 cm; sgf 12.3 mm, 10.5 cm, 21.0 cm"
    )
    assert other.strip() == "euroc_MH_01, ATE RMSE: photo 12.3 mm; sgf 12.3 mm"
    assert "euroc_MH_01 |" not in (tmp_path / "tables" / "fig6.md").read_text().split("Distance of")[1]


def test_flags_hold_the_change_the_column_and_the_frames(experiments):
    node = {**NODE, "sequences": {"a": {"folder": "a", "contents": "b", "frames": 50}}}
    node["change"] = {"exposure_low": 0.5}
    (experiments / "short.yaml").write_text(yaml.safe_dump(node))
    experiment = config.load_experiment("short")
    assert experiment.flags("a", False, "photo") == ["--change.exposure-low", "0.5", "--frames", "50"]
    assert experiment.flags("a", False, "sgf")[2:4] == ["--depth.residual", "sgf"]
    assert experiment.scene("a") == ""


def test_rendered_sequences_know_their_scene():
    experiment = config.load_experiment("fig6")
    assert experiment.scene("V1_02_medium") == "mocap_room_1"


@pytest.mark.parametrize(
    "key, value, message",
    [
        ("points", {"min_support": 3}, "points: key 'max_variance' is missing"),
        ("surface", {**NODE["surface"], "doubled_m": [0.3, 0.05]}, "doubled_m is .* least first"),
        ("surface", {**NODE["surface"], "doubled_m": [0.3]}, "it has to be two distances"),
        ("surface", {**NODE["surface"], "cell_m": 0}, "cells have to have a size"),
        ("colour", 3, "unknown key 'colour'"),
    ],
)
def test_what_is_wrong_is_named(experiments, key, value, message):
    (experiments / "bad.yaml").write_text(yaml.safe_dump({**NODE, key: value}))
    with pytest.raises(ConfigError, match=message):
        config.load_experiment("bad")
