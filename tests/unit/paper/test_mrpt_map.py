"""The MRPT module's map and trajectory: how they are moved to the ground truth, counted and drawn."""

import json
import struct

import numpy as np
import pandas as pd
import pytest
import yaml
from matplotlib import pyplot

from conftest import STEP, TIMES_S, TURN, way
from sgf_paper import config, map_view, mrpt_map, paths, summary
from sgf_paper.strict_yaml import ConfigError

NODE = yaml.safe_load((paths.EXPERIMENTS / "mrpt_map.yaml").read_text())
POINTS = np.array([[1.0, 0, 0], [0, 2, 0], [0, 0, 3]])
REPORT = "frames: 22, with pose: 21, lost: 1, restarts: 0, key-frames: 4\ngaps over 1 s: 0\n"


@pytest.fixture
def raw(tmp_path):
    """What the programs write."""
    folder = tmp_path / "raw" / "V1_02_medium"
    folder.mkdir(parents=True)
    poses = [f"{t:.6f} {x} {y} {z} 0 0 0 1\n" for t, (x, y, z) in zip(TIMES_S, way(TIMES_S))]
    (folder / "map.tum").write_text("# time x y z qx qy qz qw\n" + "".join(poses))
    header = ["ply", "format binary_little_endian 1.0", "element vertex 3"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += ["element face 0", "property float intensity", "end_header", ""]  # as MRPT writes it
    (folder / "map.ply").write_bytes("\n".join(header).encode() + struct.pack("<9f", *POINTS.ravel()))
    (folder / "report.txt").write_text(REPORT)
    (folder / "scores.json").write_text(json.dumps({"path_m": 1.5, "ate_rmse_m": 0.0123, "poses": 21}))
    return folder


def test_the_alignment_is_a_rotation_and_a_translation():
    random = np.random.default_rng(1)
    source = random.normal(size=(50, 3))
    R, t = mrpt_map.rigid_alignment(source, source @ TURN.T + STEP)
    assert np.allclose(R, TURN) and np.allclose(t, STEP)
    R, _ = mrpt_map.rigid_alignment(source, source * [1, 1, -1])
    assert np.linalg.det(R) == pytest.approx(1), "a mirror image is no rotation"


def test_map_and_path_are_moved_to_the_ground_truth(raw, sequence):
    run = mrpt_map.read_run(raw, sequence)
    assert np.abs(run.map.path - run.map.truth).max() < 1e-4  # interpolated between poses 5 ms apart
    assert np.allclose(run.map.points, POINTS @ TURN.T + STEP, atol=1e-4)
    assert run.numbers == {
        "frames": 22, "posed": 21, "keyframes": 4, "points": 3, "path_m": 1.5, "ate_rmse_m": 0.0123
    }  # fmt: skip


def test_ground_truth_may_be_a_tum_file(sequence):
    from_csv = map_view.read_truth(sequence, TIMES_S)
    folder = sequence / "mav0" / "state_groundtruth_estimate0"
    rows = (folder / "data.csv").read_text().splitlines()[1:]
    poses = [f"{int(t) * 1e-9:.9f} {x} {y} {z} 0 0 0 1\n" for t, x, y, z, *_ in (r.split(",") for r in rows)]
    (folder / "data.csv").unlink()
    (folder / "groundtruth_tum.txt").write_text("# time place rotation\n" + "".join(poses))
    assert np.allclose(map_view.read_truth(sequence, TIMES_S), from_csv, atol=1e-5)


def test_a_report_without_counts_is_named(raw):
    (raw / "report.txt").write_text("nothing\n")
    with pytest.raises(mrpt_map.ReportError, match="report.txt: no line with counts"):
        mrpt_map.read_counts(raw / "report.txt")


def test_files_hold_the_table_and_two_panels_a_sequence(raw, sequence, tmp_path):
    mrpt_map.make_figure("mrpt_map", {"V1_02_medium": (raw, sequence)}, tmp_path, tmp_path)
    table = pd.read_csv(tmp_path / "mrpt_map.csv")
    assert list(table.iloc[0]) == ["V1_02_medium", 22, 21, 4, 3, 1.5, 0.0123]
    assert "| 22 | 21 | 4 | 3 | 1.5 | 12.3 |" in (tmp_path / "mrpt_map.md").read_text()
    assert (tmp_path / "mrpt_map.pdf").stat().st_size > 1000
    experiment = config.load_experiment("mrpt_map")
    drawing = mrpt_map.draw(experiment, {"V1_02_medium": mrpt_map.read_run(raw, sequence)})
    row, _ = drawing.subfigs
    above, side, _ = row.axes  # the last is the scale of heights
    assert [axis.get_title() for axis in (above, side)] == ["from above", "from the side"]
    title = row._suptitle.get_text()
    assert "21 of 22 frames with pose" in title and "ATE RMSE 12.3 mm" in title
    assert [axis.get_ylabel() for axis in (above, side)] == ["y, m", "z, m"]
    for axis, panel in ((1, above), (2, side)):
        truth, estimate, _ = (line.get_ydata() for line in panel.lines)
        assert np.allclose(truth, estimate, atol=1e-4)
        low, high = panel.get_ylim()
        assert low < truth.min() and truth.max() < high
    pyplot.close(drawing)


def test_a_downloaded_sequence_is_at_hand_where_its_folder_is(tmp_path):
    experiment = config.load_experiment("mrpt_map")
    assert experiment.present("") == experiment.present(str(tmp_path)) == ["V1_02_medium"]
    (tmp_path / "euroc" / "MH_01_easy").mkdir(parents=True)
    assert experiment.present(str(tmp_path)) == ["V1_02_medium", "euroc_MH_01"]


def test_an_unknown_key_of_a_sequence_is_named(experiments):
    node = {**NODE, "sequences": {"a": {"folder": "a", "contents": "b", "colour": 3}}}
    (experiments / "bad.yaml").write_text(yaml.safe_dump(node))
    with pytest.raises(ConfigError, match="sequences.a: unknown key 'colour'"):
        config.load_experiment("bad")


def test_the_summary_has_a_line_per_sequence(raw, sequence, tmp_path):
    (tmp_path / "tables").mkdir()
    mrpt_map.make_figure("mrpt_map", {"V1_02_medium": (raw, sequence)}, tmp_path / "tables", tmp_path)
    _, line = summary.stage_lines(config.load_experiment("mrpt_map"), tmp_path, 0)
    assert line.strip() == "V1_02_medium: 21 of 22 frames with pose, 4 key-frames, 3 points, ATE RMSE 12.3 mm"
