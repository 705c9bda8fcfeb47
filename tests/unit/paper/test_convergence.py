"""Convergence of patch tracking: which images are used, what stands in the table, what is drawn."""

import copy

import pandas as pd
import pytest
import yaml
from matplotlib import pyplot

from sgf_paper import config, convergence, paths, summary
from sgf_paper.stereo_datasets import Dataset
from sgf_paper.strict_yaml import ConfigError

NODE = yaml.safe_load((paths.EXPERIMENTS / "convergence.yaml").read_text())
FIELDS = (
    "case,motion,levels,unit,start,column,residual,epsilon,compared,points,converged,converged_pct,"
    "converged_low_pct,converged_high_pct,own_median_px,own_low_px,own_high_px,common,"
    "common_median_px,common_low_px,common_high_px"
).split(",")
SHARES = {"photo": 10.0, "ngv": 80.0, "ngv_tile": 81.0}


@pytest.fixture
def study(experiments):
    """The experiment with fewer columns and cases."""
    node = copy.deepcopy(NODE)
    node["columns"] = {name: node["columns"][name] for name in SHARES}
    node["drawn"] = ["photo", "ngv"]
    node["cases"] = {name: node["cases"][name] for name in ("gain", "roll")}
    (experiments / "convergence.yaml").write_text(yaml.safe_dump(node, sort_keys=False))
    return config.load_experiment("convergence")


def line(case, unit, start, column):
    share = SHARES[column] - start
    compared = column != "ngv_tile"
    own = [0.1, 0.09, 0.11]
    common = [300, 0.05, 0.04, 0.06] if compared else [0, float("nan"), float("nan"), float("nan")]
    key = [case, "se2", 1, unit, start, column, column.split("_")[0], "image", compared]
    return [*key, 2000, int(20 * share), share, share - 1, share + 1, *own, *common]


@pytest.fixture
def table():
    starts = [("gain", "px", 1), ("gain", "px", 2), ("roll", "px", 2), ("roll", "deg", 20)]
    lines = [line(*start, column) for start in starts for column in SHARES]
    return pd.DataFrame(lines, columns=FIELDS)


def test_tracks_are_of_the_first_image_set_at_hand(study, tmp_path):
    folder = tmp_path / "debian"
    for pair in ("Motorcycle", "Aloe"):
        (folder / pair).mkdir(parents=True)
        (folder / pair / "im0.png").touch()
    datasets = {"debian_pairs": Dataset("debian_pairs", folder, 2)}
    assert study.images({}).datasets == []
    images = study.images(datasets)
    files = images.files(tmp_path, datasets)
    assert files[:2] == [folder / "Aloe" / "im0.png", folder / "Motorcycle" / "im0.png"]
    assert files[2:] == [tmp_path / "pairs" / name / "view.png" for name in images.rendered]
    every = {name: Dataset(name, folder, 2) for name in ("middlebury2014_q", "debian_pairs")}
    assert study.images(every).datasets == ["middlebury2014_q"]


@pytest.mark.parametrize(
    "change, message",
    [
        ({"drawn": ["photo", "sbd"]}, r"drawn: no column \['sbd'\]"),
        ({"image_sets": NODE["image_sets"][:1]}, "the last one must need no data set"),
        ({"image_sets": []}, "the last one must need no data set"),
        ({"columns": {"photo": {"metric": "photo"}}}, "columns.photo: unknown key 'metric'"),
    ],
)
def test_mistakes_are_named(experiments, change, message):
    (experiments / "bad.yaml").write_text(yaml.safe_dump({**NODE, **change}))
    with pytest.raises(ConfigError, match=message):
        config.load_experiment("bad")


def test_blocks_show_one_start_of_each_kind_most_converged_first(study, table):
    blocks = convergence.make_blocks(study, table)
    assert [(b["case"], b["start"]) for b in blocks] == [
        ("gain", "2 px"), ("roll", "2 px"), ("roll", "20 deg")
    ]  # fmt: skip
    assert [row["column"] for row in blocks[0]["rows"]] == ["ngv_tile (extra)", "ngv", "photo"]
    assert (blocks[0]["points"], blocks[0]["common"]) == (2000, 300)
    extra, ngv, _ = blocks[0]["rows"]
    assert ngv["converged"] == "78.0 [77.0, 79.0]"
    assert ngv["common"] == "0.050 [0.040, 0.060]" and extra["common"] == "–"


def test_files_hold_the_table_and_a_panel_for_each_case_and_kind(study, table, tmp_path):
    raw, datasets = tmp_path / "raw.csv", tmp_path / "datasets.tsv"
    table.to_csv(raw, index=False)
    datasets.write_text("")
    convergence.make_figure("convergence", raw, datasets, tmp_path, tmp_path)
    written = (tmp_path / "convergence.md").read_text()
    assert "| ngv | 78.0 [77.0, 79.0] | 0.100 [0.090, 0.110] | 0.050 [0.040, 0.060] |" in written
    assert "`ngv_tile` (ngv, epsilon over the tile)" in written
    assert "`gain`: exposure 0.6; `roll`: roll_deg 20, motion se2." in written
    assert len(pd.read_csv(tmp_path / "convergence.csv")) == len(table)
    drawing = convergence.draw(study, study.images({}), table)
    visible = [axis for axis in drawing.axes if axis.get_visible()]
    assert [axis.get_title() for axis in visible] == ["gain", "roll", "roll"]
    assert [len(axis.lines) for axis in visible] == [2, 2, 2]
    pyplot.close(drawing)


def test_the_summary_sorts_compared_columns_by_what_converges(study, table, tmp_path):
    (tmp_path / "tables").mkdir()
    table.to_csv(tmp_path / "tables" / "convergence.csv", index=False)
    lines = summary.stage_lines(study, tmp_path, 0)
    assert lines[1].strip() == "gain, converged from 2 px, %: ngv 78, photo 8"
