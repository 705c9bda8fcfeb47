"""Tables against values worked out by hand."""

import math
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from sgf_paper import report_grid, scores, text
from sgf_paper.deviations import Notes
from sgf_paper.scores import ScoresError
from sgf_paper.stereo_config import Column, Parameters
from sgf_paper.table import (
    CHOICE_COLUMNS,
    CSV_COLUMNS,
    choice_texts,
    make_report,
    options_of_columns,
    write_csvs,
)


@pytest.fixture
def report(table, write_raw):
    return make_report(table, write_raw(), ["toys"])


def value(frame, cost, quantity, dataset="toys", region="all", name="measured"):
    rows = frame[
        (frame["dataset"] == dataset)
        & (frame["region"] == region)
        & (frame["cost"] == cost)
        & (frame["quantity"] == quantity)
    ]
    return rows[name].item()


def test_fixed_values_are_means_over_scenes(report):
    # sgf at window 9, uniqueness 10: scenes 0.9, 1.9, 3.4
    assert value(report.fixed, "sgf", "mean_px") == pytest.approx(6.2 / 3)
    assert value(report.fixed, "sgf", "bad2_pct") == pytest.approx(20 * 6.2 / 3)
    assert value(report.fixed, "sgf", "median_px") == pytest.approx(1.9)
    assert value(report.fixed, "sgf", "mean_px", name="scenes") == 3


def test_a_column_may_have_its_own_parameters(report):
    # orig at uniqueness 20: scenes 1.8, 2.8, 4.3
    assert value(report.fixed, "orig", "mean_px") == pytest.approx(8.9 / 3)
    assert value(report.fixed, "orig", "invalid_pct") == pytest.approx(40)


def test_published_values_of_an_absent_dataset_stand_alone(report):
    assert value(report.fixed, "sgf", "mean_px", "big", "noc", "published") == 3.29
    assert math.isnan(value(report.fixed, "sgf", "mean_px", "big"))
    assert value(report.fixed, "sgf", "mean_px", "big", name="scenes") == 0
    assert "ugf" not in set(report.fixed.loc[report.fixed["dataset"] == "big", "cost"])


def test_published_values_stand_beside_their_own_dataset_only(table, write_raw):
    write_raw("big", regions=("all",))
    report = make_report(table, write_raw("toys"), ["big", "toys"])
    assert value(report.fixed, "sgf", "mean_px", "big", name="published") == 3.29
    assert value(report.fixed, "sgf", "mean_px", "big") == pytest.approx(6.2 / 3)
    assert report.fixed.loc[report.fixed["dataset"] == "toys", "published"].isna().all()
    assert set(report.fixed.loc[report.fixed["dataset"] == "big", "region"]) == {"all"}


def test_scenes_won_count_the_papers_columns_only_and_ties_for_all(table, write_raw):
    def error(column, scene, *_):
        return {"orig": 1.0, "sgf": 1.0 if scene == "a" else 2.0, "ugf": 0.1}[column]

    report = make_report(table, write_raw(error=error), ["toys"])
    wins = report.wins[(report.wins["region"] == "all") & (report.wins["quantity"] == "mean_px")]
    assert dict(zip(wins["cost"], wins["won"])) == {"orig": 3, "sgf": 1}
    assert set(wins["scenes"]) == {3}


def test_a_scene_without_a_match_is_left_out_of_the_mean_and_of_the_count(table, write_raw):
    def error(column, scene, *_):
        return math.nan if scene == "a" else 2.0

    report = make_report(table, write_raw(error=error), ["toys"])
    assert value(report.fixed, "sgf", "mean_px") == 2.0
    assert value(report.fixed, "sgf", "mean_px", name="scenes") == 2
    assert value(report.fixed, "sgf", "invalid_pct", name="scenes") == 3


def test_cross_validated_values_use_the_other_folds_parameters(report):
    # Folds: a and c against b. Trained on b, window 9 is best; on a and c both windows are equal
    # (one prefers each), so the first, 5, is taken. 70 % kept is uniqueness 10 throughout.
    chosen = report.choices[(report.choices["column"] == "sgf") & (report.choices["region"] == "all")]
    assert dict(zip(chosen["fold"], chosen["parameters"])) == {0: Parameters(9, 10), 1: Parameters(5, 10)}
    # a at 9: 0.9; c at 9: 3.4; b at 5: 2.4
    assert value(report.tuned, "sgf", "mean_px") == pytest.approx(6.7 / 3)
    assert value(report.tuned, "sgf", "mean_px", name="scenes") == 3


def test_filled_columns_are_scored_and_not_tuned(table, sweep, write_raw):
    sweep.columns["ugf"] = Column("bm", fill=True, extra=True)
    report = make_report(table, write_raw(), ["toys"])
    assert "ugf" in set(report.fixed["cost"])
    assert "ugf" not in set(report.tuned["cost"]) | set(report.choices["column"])


def test_one_scene_gives_no_cross_validated_rows(table, write_raw):
    report = make_report(table, write_raw(scenes=("a",)), ["toys"])
    assert report.tuned.empty and report.choices.empty
    assert not report.fixed.empty


def test_choices_as_text():
    rows = [
        ("d", "all", "stereo_bm", "sgf", 0, Parameters(9, 10.0), True),
        ("d", "all", "stereo_bm", "pm", 1, Parameters(5, 2.0), False),
    ]
    texts = choice_texts(pd.DataFrame(rows, columns=CHOICE_COLUMNS))
    assert texts == {"d, all, StereoBM": {"sgf": ["9 px, 10 %", "–"], "pm": ["–", "5 px, 2 % *"]}}


def test_options_are_listed_without_those_that_the_sweep_sets(sweep, write_raw):
    options = options_of_columns(write_raw(), sweep, "toys")
    assert options["sgf"] == "metric sgf, nested.a 1"
    assert list(options) == list(sweep.columns)


def test_penalties_that_follow_the_window_are_not_listed_for_opencv(sweep, write_raw):
    raw = write_raw()
    for column in ("orig", "sgf"):
        path = scores.raw_path(raw, "toy", "toys", column).with_suffix(".options.yaml")
        path.write_text("options: {p1: 72, p2: 288, mode: sgbm}\n")
    options = options_of_columns(raw, sweep, "toys")
    assert (options["orig"], options["sgf"]) == ("mode sgbm", "p1 72, p2 288, mode sgbm")


def test_csv_files_hold_the_contract(report, tmp_path):
    write_csvs(report, tmp_path, "table9")
    lines = (tmp_path / "table9.csv").read_text().splitlines()
    assert lines[0] == "dataset,region,matcher,cost,quantity,measured,published,scenes"
    assert lines[0].split(",") == CSV_COLUMNS
    assert "toys,all,stereo_bm,sgf,mean_px,2.0667,,3" in lines
    assert "big,all,stereo_bm,sgf,mean_px,,3.29,0" in lines
    scenes = pd.read_csv(tmp_path / "table9_scenes.csv")
    assert len(scenes) == 3 * 2 * 3
    assert (tmp_path / "table9_tuned.csv").exists() and (tmp_path / "table9_wins.csv").exists()


def test_matchers_stand_together_and_are_measured_apart(two_blocks, dense_sweep, write_raw, tmp_path):
    write_raw(of=dense_sweep, error=lambda column, *_: {"orig": 1.0, "sgf": 0.5}[column])
    report = make_report(two_blocks, write_raw(), ["toys"])
    order = report.fixed[["dataset", "region", "matcher"]].drop_duplicates().to_numpy().tolist()
    assert order == [
        [dataset, region, matcher]
        for dataset in ("toys", "big")
        for region in ("all", "noc")
        for matcher in ("stereo_bm", "stereo_mesh")
    ]
    mesh = report.fixed[report.fixed["matcher"] == "stereo_mesh"]
    assert value(mesh, "sgf", "mean_px") == 0.5
    assert value(mesh, "sgf", "mean_px", "big", name="published") == 4.17
    assert set(report.tuned["matcher"]) == {"stereo_bm"} == set(report.choices["matcher"])
    wins = report.wins[report.wins["matcher"] == "stereo_mesh"]
    assert dict(zip(wins["cost"], wins["won"])) == {"orig": 0, "sgf": 3}
    write_csvs(report, tmp_path, "two")
    lines = (tmp_path / "two.csv").read_text().splitlines()
    assert "toys,all,stereo_mesh,sgf,mean_px,0.5000,,3" in lines
    assert len(pd.read_csv(tmp_path / "two_scenes.csv")) == 3 * 2 * (3 + 2)


@pytest.fixture
def blocks(report, table, sweep):
    return text.make_blocks(report.fixed, report.wins, table.quantities, sweep.main_columns)


def test_only_the_best_column_of_the_paper_is_marked(blocks):
    first = blocks[0]
    assert (first.dataset, first.region, first.matcher, first.scenes) == ("toys", "all", "StereoBM", 3)
    marked = {row.cost: [cell.best for cell in row.cells] for row in first.rows}
    assert marked["sgf"] == [True, True, True, False]
    assert not any(marked["orig"]) and not any(marked["ugf"])
    assert [row.won for row in first.rows] == ["0/3", "3/3", ""]
    published = blocks[-1]
    assert not any(cell.best for row in published.rows for cell in row.cells)


def test_a_mean_of_fewer_scenes_says_so_and_is_not_marked(table, sweep, write_raw):
    def error(column, scene, *_):
        return math.nan if (column, scene) == ("sgf", "a") else {"orig": 2.0, "sgf": 1.0, "ugf": 3.0}[column]

    report = make_report(table, write_raw(error=error), ["toys"])
    block = text.make_blocks(report.fixed, report.wins, table.quantities, sweep.main_columns)[0]
    cells = {row.cost: row.cells[0] for row in block.rows}
    assert (cells["sgf"].shown, cells["sgf"].best) == ("1.00 (2 of 3)", False)
    assert (cells["orig"].shown, cells["orig"].best) == ("2.00", True)
    assert [cell.shown for cell in block.rows[1].cells] == ["1.00 (2 of 3)"] * 2 + ["20.00 (2 of 3)", "30.00"]
    for extension in ("md", "tex"):
        document = render(extension, [block], table)
        assert "1.00 (2 of 3)" in document and "1.00**" not in document and "textbf{1.00" not in document
    links = report_grid.Links(Path("/nonexistent"))
    grid = report_grid._stereo_grid(table, block, "fixed", links, None, NOTES)
    assert grid.rows[1][1].shown == "1.00 (2 of 3)" and not grid.rows[1][1].best


NOTES = Notes({"stereo_bm": {"all": ["shared"], "orig": ["other", "own"]}}, {"shared": 7, "own": 3, "other": 12})


def render(extension, blocks, table):
    return text.render(
        f"table.{extension}.j2",
        notes=replace(NOTES, used=set()),
        table=table,
        labels=[text.LABELS[quantity] for quantity in table.quantities],
        absent=["big"],
        fixed=blocks,
        tuned=[],
        choices={},
        folds={"toys": {"a": 0, "b": 1}},
        options={s.name: {column: f"metric {column}" for column in s.columns} for s in table.sweeps},
    )


def test_markdown_shows_measured_and_published_and_what_is_absent(blocks, two_blocks):
    document = render("md", blocks, two_blocks)
    assert "| sgf | **2.07** | **1.90** | **41.33** | 30.00 | 3/3 |" in document
    assert "| sgf | – (3.29) |" in document
    assert "Not present, so not measured: big." in document
    assert "The paper does not state its region" in document
    assert "Not possible here" in document
    assert "| orig | opencv_bm | metric orig |" in document
    assert "| orig | mesh | metric orig |" in document
    assert "StereoBM, fixed: window 9 px, uniqueness 10 %; orig: uniqueness 20." in document
    assert "MeshStereo, fixed: window 35 px, uniqueness 0 %." in document
    assert "- StereoBM: bad2_pct with 70 % kept; 2 windows x 3 values" in document
    assert "- MeshStereo" not in document


def test_rows_link_to_what_they_have_otherwise_than_the_paper(blocks, table):
    document = render("md", blocks, table)
    link = "[{}](../../docs/deviations.md#{})".format
    assert f"| orig <sup>{link(3, 'own')} {link(12, 'other')}</sup> |" in document
    assert "| ugf (extra) |" in document
    document = render("tex", blocks, table)
    assert "\norig\\textsuperscript{3,12} & " in document
    assert "3 \\texttt{own}, 12 \\texttt{other}.\\par}" in document


def test_latex_is_a_tabular_of_equal_rows(blocks, table):
    document = render("tex", blocks, table)
    body = document.split("\\midrule", 1)[1].split("\\bottomrule")[0]
    rows = [line for line in body.splitlines() if line.endswith("\\\\") and "multicolumn" not in line]
    assert rows and {row.count(" & ") for row in rows} == {len(table.quantities)}
    assert "\\textbf{2.07}" in document and "bad 2 \\%" in document
    assert "\n\n" not in body


def test_a_raw_file_without_a_column_is_named(sweep, write_raw):
    raw = write_raw()
    path = scores.raw_path(raw, sweep.name, "toys", "sgf")
    path.write_text(path.read_text().replace("invalid_pct", "invalid"))
    with pytest.raises(ScoresError, match="sgf.csv: no column invalid_pct"):
        scores.read_scores(raw, sweep, "toys")


def test_an_empty_raw_file_is_named(sweep, write_raw):
    raw = write_raw(scenes=())
    with pytest.raises(ScoresError, match="orig.csv: no scores"):
        scores.read_scores(raw, sweep, "toys")
