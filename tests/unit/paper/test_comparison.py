"""Published values beside measured ones: marked only where data set, size and protocol are the same."""

import pandas as pd
import pytest

from sgf_paper import comparison, config
from sgf_paper.published_values import Comparison, Tolerance
from sgf_paper.strict_yaml import ConfigError

BM_SGF = {"part": "stereo_bm, all", "row": "sgf", "column": "mean_px"}  # published: 3.29


def stereo_line(dataset, scenes, measured, matcher="stereo_bm"):
    return {"dataset": dataset, "region": "all", "matcher": matcher, "cost": "sgf", "quantity": "mean_px",
            "measured": measured, "published": 3.29, "scenes": scenes}  # fmt: skip


def compare(**tables):
    return comparison.compare(lambda name: pd.DataFrame(tables[name]) if name in tables else None)


def line_of(frame, **wanted):
    return frame[(frame[list(wanted)] == pd.Series(wanted)).all(axis=1)].iloc[0]


@pytest.mark.parametrize("measured, mark", [(3.29, "pass"), (3.7, "pass"), (3.9, "near"), (2.1, "near"), (4.7, "fail")])
def test_values_of_the_same_pairs_are_marked(measured, mark):
    found = compare(table1=[stereo_line("middlebury2014_h", 15, measured)])
    line = line_of(found, **BM_SGF)
    assert (line["mark"], line["measured"], line["published"]) == (mark, measured, 3.29)


@pytest.mark.parametrize(
    "dataset, scenes, reason",
    [
        ("middlebury2014_q", 15, "middlebury2014_h is not at hand"),
        ("debian_pairs", 2, "middlebury2014_h is not at hand"),
        ("middlebury2014_h", 14, "14 of 15 have a value"),
    ],
)
def test_other_data_sizes_and_parts_of_them_are_not_marked(dataset, scenes, reason):
    found = compare(table1=[stereo_line(dataset, scenes, 3.29)])
    own = found[(found["table"] == "table1") & (found["row"] == "sgf") & (found["column"] == "mean_px")]
    own = own[own["part"].str.startswith("stereo_bm")]
    assert list(own["mark"]) == ["–"] and list(own["reason"]) == [reason]


def euroc_line(sequence, measured, dataset="euroc", system="vio_sgf3", runs=10):
    return {"dataset": dataset, "sequence": sequence, "system": system, "quantity": "ate_mean_m", "measured": measured,
            "published": 0.061, "runs": runs}  # fmt: skip


def test_a_sequence_is_marked_by_itself_and_the_average_needs_all_ten():
    joined = config.load_experiment("table3")
    names = [s.euroc_name for s in joined.sequences if s.published and s.published != "V23"]
    frame = compare(table3=[euroc_line("MH_01_easy", 0.062)])
    assert line_of(frame, row="basalt_sgf3", column="MH1")["mark"] == "pass"
    missing = line_of(frame, row="basalt_sgf3", column="avg")
    assert missing["mark"] == "–" and "not at hand in full" in missing["reason"]
    frame = compare(table3=[euroc_line(name, 0.2) for name in dict.fromkeys(names)])
    average = line_of(frame, row="basalt_sgf3", column="avg")
    assert (average["mark"], average["size"]) == ("fail", 10) and average["measured"] == pytest.approx(0.2)


@pytest.mark.parametrize(
    "runs, mark, reason", [(1, "–", "1 run; the paper's values are means"), (9, "–", "9 runs; "), (10, "pass", "off by")]
)
def test_a_mean_is_marked_only_if_it_is_of_as_many_runs_as_a_ranking_takes(runs, mark, reason):
    line = line_of(compare(table3=[euroc_line("MH_01_easy", 0.062, runs=runs)]), row="basalt_sgf3", column="MH1")
    assert line["mark"] == mark and line["reason"].startswith(reason)


def test_the_average_has_as_many_runs_as_its_sequence_with_the_fewest():
    joined = config.load_experiment("table3")
    names = dict.fromkeys(s.euroc_name for s in joined.sequences if s.published and s.published != "V23")
    lines = [euroc_line(name, 0.063, runs=9 if name == "MH_05_difficult" else 12) for name in names]
    frame = compare(table3=lines)
    assert line_of(frame, row="basalt_sgf3", column="avg")["reason"].startswith("9 runs; ")
    assert line_of(frame, row="basalt_sgf3", column="V11")["runs"] == 12


@pytest.mark.parametrize("dataset", ["synthetic", "euroc_slice"])
def test_rendered_flights_and_cuts_are_not_marked(dataset):
    frame = compare(table3=[euroc_line("MH_01_easy", 0.061, dataset)])
    assert line_of(frame, row="basalt_sgf3", column="MH1")["mark"] == "–"


def test_figure_1_is_never_marked_as_its_change_is_not_stated():
    key = {"group": "icl_kt2", "frame": 120, "case": "noise_free", "cost": "sgf"}
    line = {**key, "first_disparity": 0, "mean_px": 1.21}
    found = line_of(compare(fig1=[line]), table="fig1", row="sgf", column="120")
    assert found["measured"] == 1.21 and found["mark"] == "–" and "does not state" in found["reason"]


def test_every_published_value_is_there_with_a_tolerance_and_reasons():
    frame = compare()
    assert frame.groupby("table").size().to_dict() == {"table1": 50, "table2": 50, "table3": 121, "fig1": 14}
    assert frame["reason"].str.len().min() > 5 and frame["tolerance"].str.len().min() > 5
    assert (frame["pass_within"] > 0).all() and (frame["near_within"] > frame["pass_within"]).all()
    assert (frame["mark"] == "–").all()


def test_a_value_without_a_tolerance_is_an_error():
    value = comparison.Value("stereo_bm, all", "sgf", "mean_px", "mean_px", 3.29, 3.3, 15)
    only_sad = Comparison("table1", 15, "", [Tolerance("why", {"row": "sad"})])
    with pytest.raises(ConfigError, match="here: no tolerance for sgf mean_px"):
        comparison.find_tolerance(only_sad, value, "here")
    with pytest.raises(ConfigError, match=r"unknown key \['cost'\]"):
        comparison.find_tolerance(Comparison("table1", 15, "", [Tolerance("why", {"cost": "sad"})]), value, "here")


def test_the_averages_of_the_two_dso_rows_are_not_those_of_their_values():
    table = comparison.averages().set_index("system")
    assert list(table.index[table["off_m"] > 0.001]) == ["dso", "dso_sgf"]
    assert table.loc["dso", "mean"] == pytest.approx(0.2483) and table.loc["dso_sgf", "mean"] == pytest.approx(0.2268)
    assert table.loc["dso", "mean_of_one_more"] == pytest.approx(0.226, abs=5e-4)
