"""Errors before and after a change of light: what is compared with what, and what is shown."""

import math
from dataclasses import replace

import matplotlib.pyplot as plt
import pandas as pd
import pytest

from conftest import mean_error
from sgf_paper import config, light_change, paths, summary
from sgf_paper.stereo_config import LightChange
from sgf_paper.strict_yaml import ConfigError


@pytest.fixture
def experiment(table, monkeypatch):
    """Of the toy table, without one of its columns; scene `bL` is `b` under other light."""
    monkeypatch.setattr(config, "load_experiment", {"table9": table}.get)
    return LightChange(
        kind="light_change",
        name="light_change",
        title="A toy under light",
        table="table9",
        datasets=["toys"],
        columns=["orig", "sgf"],
        twins={"bL": "b", "c": ""},
        changes={"dim": {"exposure": 0.5}},
    )


def changed_error(column, scene, window, uniqueness):
    """Scene a gets worse by 1 px with `sgf`, by 3 px with `orig`; scene c is lost by `orig`."""
    if column == "orig" and scene == "c":
        return math.nan
    worse = {"orig": 3.0, "sgf": 1.0, "ugf": 9.0}[column]
    return mean_error(column, scene, window, uniqueness) + (worse if scene == "a" else 0)


@pytest.fixture
def raw(experiment, sweep, write_raw, tmp_path):
    """Unchanged and changed scores; scene `bL` is worse than `b` by 0.5 px."""

    def with_twin(column, scene, window, uniqueness):
        return mean_error(column, scene, window, uniqueness) + (0.5 if scene == "bL" else 0)

    scenes = ("a", "b", "bL", "c")
    write_raw(scenes=scenes, error=changed_error)
    changed = tmp_path / "raw" / "light_change" / "dim"
    changed.mkdir(parents=True)
    (tmp_path / "raw" / sweep.name).rename(changed / sweep.name)
    (changed / sweep.name / "toys" / "ugf.csv").unlink()  # not a column of the experiment
    return write_raw(scenes=scenes, error=with_twin)


@pytest.fixture
def lines(experiment, raw):
    """The table by region, case and column."""
    made = light_change.make_table(experiment, raw, ["toys"])
    assert list(made.columns) == light_change.CSV_COLUMNS
    assert len(made) == 2 * 3 * 2
    return made.set_index(["region", "case", "cost"])


def test_a_twin_is_compared_with_the_same_scene_unchanged(lines):
    line = lines.loc["all", "bL", "sgf"]
    # window 9, uniqueness 10: scene b has 1 + 1 - 0.1
    assert line["mean_px_before"] == pytest.approx(1.9)
    assert line["mean_px_after"] == pytest.approx(2.4)
    assert line["mean_px_rise"] == pytest.approx(0.5)
    assert line["scenes"] == 1


def test_a_scene_without_twin_has_an_after_only(lines):
    line = lines.loc["noc", "c", "sgf"]
    assert line["mean_px_after"] == pytest.approx(3.4)
    assert math.isnan(line["mean_px_before"]) and math.isnan(line["mean_px_rise"])


def test_a_made_change_is_compared_over_all_scenes(lines):
    line = lines.loc["all", "dim", "sgf"]
    assert line["scenes"] == 4
    # twin bL is worse by 0.5 px in the unchanged scores only
    assert line["mean_px_rise"] == pytest.approx((1 - 0.5) / 4)
    assert line["invalid_pct_before"] == line["invalid_pct_after"] == 30


def test_columns_have_their_own_fixed_parameters_and_scenes_with_both_scores(lines):
    line = lines.loc["all", "dim", "orig"]
    # uniqueness 20 for orig; scene c has no score after the change, so a, b and bL count
    before = [2 - 0.2, 3 - 0.2, 3.5 - 0.2]
    assert line["scenes"] == 3
    assert line["mean_px_before"] == pytest.approx(sum(before) / 3)
    assert line["mean_px_rise"] == pytest.approx((3 - 0.5) / 3)
    assert line["invalid_pct_after"] == 40


def test_pixels_within_2_px_count_unmatched_and_wrong_ones(lines):
    # the toy's bad 2 % is 20 times its mean error; 70 % of the pixels are kept
    assert lines.loc["all", "bL", "sgf"]["within2_pct_after"] == pytest.approx(70 * (1 - 0.48))
    # of scenes a, b, bL and c, the last has nothing matched: 0 and not left out
    after = [60 * (1 - 0.2 * error) for error in (1.8 + 3, 2.8, 2.8)]
    assert lines.loc["all", "dim", "orig"]["within2_pct_after"] == pytest.approx(sum(after) / 4)


def test_the_document_marks_the_least_rise(experiment, lines):
    blocks = light_change.make_blocks(lines.reset_index())
    assert [(b["region"], b["case"]) for b in blocks[:3]] == [("all", "bL"), ("all", "c"), ("all", "dim")]
    rows = {row["cost"]: row["values"]["mean_px"] for row in blocks[2]["rows"]}
    assert rows["sgf"][2:] == ["**0.12**", "0.00"]  # of rises 1, 0, -0.5 and 0
    assert rows["orig"][2:] == ["0.83", "0.00"]  # of rises 3, 0 and -0.5
    alone = {row["cost"]: row["values"]["mean_px"] for row in blocks[1]["rows"]}
    assert alone["sgf"] == ["–", "3.40", "–", "–"]


def test_the_figure_has_two_bars_a_column_and_no_case_without_before(experiment, lines):
    table = lines.reset_index()
    figure = light_change.draw(experiment, table)
    titles = [axis.get_title() for axis in figure.axes]
    assert titles == ["StereoBM: bL, 1 scene", "StereoBM: dim, 4 scenes"]
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    wanted = table[(table["region"] == "all") & (table["case"] == "bL")]
    pairs = zip(wanted["mean_px_before"], wanted["mean_px_after"])
    assert heights == pytest.approx([height for pair in pairs for height in pair])
    plt.close(figure)


def test_bars_end_at_the_limit_and_say_how_far_they_would_go(experiment, lines):
    table = lines.reset_index()
    table.loc[table["cost"] == "orig", "mean_px_after"] = 50.0
    table.loc[table["cost"] == "orig", "mean_px_rise"] = 47.0
    figure = light_change.draw(experiment, table)
    assert max(bar.get_height() for bar in figure.axes[0].patches) == light_change.LIMIT_PX
    assert "+47.00" in [label.get_text() for label in figure.axes[0].texts]
    plt.close(figure)


def test_files_and_summary(experiment, table, raw, datasets, tmp_path, monkeypatch):
    experiments = {"table9": table, "light_change": experiment}
    monkeypatch.setattr(config, "load_experiment", experiments.get)
    listing = tmp_path / "datasets.tsv"
    listing.write_text(f"toys\t{datasets['toys'].folder}\t4\nothers\tx\t1\n")
    light_change.make_light_change("light_change", raw, listing, tmp_path, tmp_path)
    frame = pd.read_csv(tmp_path / "light_change.csv")
    assert set(frame["dataset"]) == {"toys"}
    document = (tmp_path / "light_change.md").read_text()
    assert "StereoBM: window 9, uniqueness 10 (orig: uniqueness 20)." in document
    assert "- c: as the data set's authors took it, without a pair to compare with" in document
    row = "| StereoBM | sgf | 1 | 1.90 | 2.40 | **0.50** | 0.50 | 38.00 | 48.00 | 10.00 | 30.00 | 30.00 | 0.00 |"
    assert row in document
    assert (tmp_path / "light_change.png").stat().st_size > 5000
    lines = summary._light_change_lines(tmp_path / "light_change.csv")
    assert "toys all, dim, StereoBM, rise of mean px: sgf +0.12, orig +0.83" in lines
    assert not any(", c," in line for line in lines)


def test_columns_must_be_in_every_sweep_of_the_table(tmp_path, monkeypatch):
    real = (paths.EXPERIMENTS / "light_change.yaml").read_text()
    table = (paths.EXPERIMENTS / "table1.yaml").read_text()
    monkeypatch.setattr(paths, "EXPERIMENTS", tmp_path)
    (tmp_path / "table1.yaml").write_text(table)
    (tmp_path / "light_change.yaml").write_text(real.replace("census]", "ugf]"))
    with pytest.raises(ConfigError, match="no column .'ugf'. in sweep stereo_mesh"):
        config.load_experiment("light_change")
    (tmp_path / "light_change.yaml").write_text(real)
    experiment = config.load_experiment("light_change")
    present = replace(experiment, datasets=["b", "a"]).present({"a": None, "b": None, "c": None})
    assert present == ["b", "a"]
