"""Folds, density curves and the choice of parameters."""

import math

import pandas as pd
import pytest

from sgf_paper import config
from sgf_paper.scores import ERRORS, curve, interpolate
from sgf_paper.stereo_config import Parameters, Tuning
from sgf_paper.tuning import assign_folds, choose


def lines(points, scene="a"):
    """Raw lines from (window, uniqueness, kept, error)."""
    rows = []
    for window, uniqueness, kept, error in points:
        row = {"scene": scene, "window": window, "uniqueness": uniqueness, "kept_pct": kept}
        rows.append({**row, **dict.fromkeys(ERRORS, error)})
    return pd.DataFrame(rows)


TUNING = Tuning("bad2_pct", 60)


def test_near_duplicates_share_a_fold_and_folds_alternate():
    scenes = ["Piano", "PianoL", "Adirondack", "Motorcycle", "MotorcycleE", "ArtL"]
    folds = assign_folds(scenes, [["Motorcycle", "MotorcycleE"], ["Piano", "PianoL"]])
    assert folds == {
        "Adirondack": 0, "ArtL": 1, "Motorcycle": 0, "MotorcycleE": 0, "Piano": 1, "PianoL": 1,
    }  # fmt: skip


def test_middleburys_near_duplicates_share_a_fold():
    names = (
        "Adirondack ArtL Jadeplant Motorcycle MotorcycleE Piano PianoL Pipes Playroom Playtable "
        "PlaytableP Recycle Shelves Teddy Vintage"
    ).split()
    folds = assign_folds(names, config.load_experiment("table1").near_duplicates)
    for one, other in (("Motorcycle", "MotorcycleE"), ("Piano", "PianoL"), ("Playtable", "PlaytableP")):
        assert folds[one] == folds[other]
    assert sorted([list(folds.values()).count(0), list(folds.values()).count(1)]) == [7, 8]


def test_numbered_scenes_are_dealt_by_even_and_odd():
    folds = assign_folds([f"{i:06}" for i in range(12)], [])
    assert all(fold == int(scene) % 2 for scene, fold in folds.items())


def test_curve_averages_scenes_and_drops_points_that_lack_one():
    one = lines([(9, 0, 80, 4), (9, 10, 60, 2), (9, 20, 40, 1), (5, 0, 99, 9)], "a")
    two = lines([(9, 0, 70, 6), (9, 10, 50, 4), (9, 20, 0, math.nan)], "b")
    points = curve(pd.concat([one, two]), 9)
    assert list(points["kept_pct"]) == [55, 75]
    assert list(points["mean_px"]) == [3, 5]
    assert list(points["uniqueness"]) == [10, 0]


def test_interpolation_is_linear_inside_and_nan_outside():
    points = curve(lines([(9, 0, 80, 4), (9, 10, 60, 2)]), 9)
    assert interpolate(points, "mean_px", 65) == pytest.approx(2.5)
    assert interpolate(points, "mean_px", 80) == pytest.approx(4)
    assert math.isnan(interpolate(points, "mean_px", 81))
    assert math.isnan(interpolate(points, "mean_px", 59))
    assert math.isnan(interpolate(points.iloc[:0], "mean_px", 70))


def test_the_best_window_at_the_wanted_share_is_chosen_not_the_lowest_error():
    # window 5 has the lowest error, but only where it keeps few pixels
    train = lines([(5, 0, 70, 10), (5, 10, 55, 7), (5, 20, 30, 0.5), (9, 0, 75, 8), (9, 10, 58, 5)])
    assert choose(train, TUNING) == (Parameters(9, 10), True)


def test_a_column_that_cannot_keep_enough_takes_the_nearest():
    train = lines([(5, 0, 40, 3), (5, 10, 30, 2), (9, 0, 45, 9), (9, 10, 20, 1)])
    assert choose(train, TUNING) == (Parameters(9, 0), False)


def test_without_any_point_there_is_no_choice():
    assert choose(lines([(5, 0, 0, math.nan)]), TUNING) is None
