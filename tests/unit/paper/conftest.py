"""Small raw scores whose tables can be worked out by hand, and the ground truth of a flight."""

import itertools
import json

import numpy as np
import pandas as pd
import pytest

from sgf_paper import odometry_scores, paths
from sgf_paper.stereo_config import Column, Grid, Sweep, Table, TableBlock, Tuning
from sgf_paper.stereo_datasets import Dataset

HEADER = (
    "dataset,scene,region,matcher,column,window,uniqueness,truth_px,matched_px,"
    "mean_px,bad1_pct,bad2_pct,bad4_pct,d1_pct,invalid_pct,seconds\n"
)
# Notes its arguments and says that the errors are as large as the number in the trajectory's file, and all
# that is a success is one.
SGF_EVAL = """#!/usr/bin/python3
import json, pathlib, sys
estimate = pathlib.Path(sys.argv[2])
with open(pathlib.Path(__file__).with_name("calls"), "a") as calls:
    print(*sys.argv[1:], sep="\\t", file=calls)
error = json.loads(estimate.read_text())
names = json.loads(pathlib.Path(__file__).with_name("names").read_text())
out = pathlib.Path(sys.argv[sys.argv.index("--out") + 1])
scores = {name: name.startswith("success") or error for name in names}
out.write_text(json.dumps({"poses": 99, **scores}))
"""
TIMES_S = 1.4e9 + 0.05 * np.arange(21)
# Of the estimate's coordinates in the world: a turn about z by 90 degrees, and a step.
TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
STEP = np.array([5.0, -2, 1])


@pytest.fixture
def sweep():
    columns = {
        "orig": Column("opencv_bm"),
        "sgf": Column("bm", {"metric": "sgf"}),
        "ugf": Column("bm", {"metric": "ugf"}, extra=True),
    }
    grid = Grid(windows=[5, 9], uniqueness=[0, 10, 20])
    return Sweep("toy", "stereo_bm", {}, columns, grid, options={"left_right_max": 1})


@pytest.fixture
def dense_sweep():
    """A matcher that leaves no pixel out, so that there is nothing to sweep or to tune."""
    columns = {"orig": Column("mesh", {"metric": "census_sobel"}), "sgf": Column("mesh")}
    return Sweep("dense", "stereo_mesh", {}, columns, Grid(windows=[35], uniqueness=[0]))


@pytest.fixture
def block(sweep):
    return TableBlock(
        sweep,
        fixed={"window": 9, "uniqueness": 10},
        fixed_of={"orig": {"uniqueness": 20}},
        tuning=Tuning("bad2_pct", 70),
        published="stereo_bm",
    )


@pytest.fixture
def table(block):
    return Table(
        kind="table",
        name="table9",
        title="A toy & a table",
        datasets=["big", "toys"],
        published="table_1_middlebury_2014_training_half",
        published_dataset="big",
        quantities=["mean_px", "median_px", "bad2_pct", "invalid_pct"],
        blocks=[block],
        near_duplicates=[["b", "bL"]],
    )


@pytest.fixture
def two_blocks(table, dense_sweep):
    """The table with a block of the dense matcher after the first."""
    table.blocks.append(
        TableBlock(dense_sweep, fixed={"window": 35, "uniqueness": 0}, published="mesh_stereo")
    )
    return table


def mean_error(column, scene, window, uniqueness):
    """Scene's index plus a column's handicap; window 5 is better for scene c, 9 for the rest."""
    handicap = {"orig": 2.0, "sgf": 1.0, "ugf": 1.5}[column]
    window_error = 0.0 if (window == 5) == (scene == "c") else 0.5
    return "abc".index(scene[0]) + handicap + window_error - uniqueness / 100


@pytest.fixture
def write_raw(tmp_path, sweep):
    """Writes raw scores of some scenes; returns the folder of raw scores."""

    def write(
        dataset="toys", scenes=("a", "b", "c"), regions=("all", "noc"), error=mean_error, of=sweep
    ):
        folder = tmp_path / "raw" / of.name / dataset
        folder.mkdir(parents=True, exist_ok=True)
        for column in of.columns:
            lines = [HEADER]
            points = itertools.product(scenes, regions, of.grid.windows, of.grid.uniqueness)
            for scene, region, window, uniqueness in points:
                mean = error(column, scene, window, uniqueness)
                scores = [mean, 30 * mean, 20 * mean, 10 * mean, 15 * mean, 20 + uniqueness]
                numbers = ",".join("nan" if s != s else f"{s:.6f}" for s in scores)
                key = f"{dataset},{scene},{region},{of.matcher},{column},{window},{uniqueness}"
                lines.append(f"{key},1000,700,{numbers},0.1\n")
            (folder / f"{column}.csv").write_text("".join(lines))
            options = f"options: {{metric: {column}, window: 21, nested: {{a: 1}}}}\n"
            (folder / f"{column}.options.yaml").write_text(options)
        return tmp_path / "raw"

    return write


@pytest.fixture
def experiments(tmp_path, monkeypatch):
    """An empty folder in place of paper/experiments."""
    monkeypatch.setattr(paths, "EXPERIMENTS", tmp_path)
    return tmp_path


@pytest.fixture
def datasets(tmp_path):
    return {"toys": Dataset("toys", tmp_path / "toys", 3)}


@pytest.fixture
def sgf_eval(tmp_path):
    """A stand-in for sgf_eval, and what says how it was called: a list of words per call."""
    program = tmp_path / "sgf_eval"
    program.write_text(SGF_EVAL)
    program.chmod(0o755)
    names = [*odometry_scores.ERRORS, *odometry_scores.OWN_SCORES]
    (tmp_path / "names").write_text(json.dumps(names))
    return program, lambda: [line.split("\t") for line in (tmp_path / "calls").read_text().splitlines()]


@pytest.fixture
def write_runs(tmp_path):
    """Writes what programs leave of runs that begin alike: an error and poses of 100 frames by column."""

    def write(conditions, errors, posed):
        folder = tmp_path / "run_0"
        for condition, column in itertools.product(conditions, errors):
            run = folder / condition / column
            run.mkdir(parents=True)
            (run / "trajectory.txt").write_text(str(errors[column]))
            summary = {"frames": 100, "posed": posed[column], "clipped_share": 0.0125}
            (run / "summary.json").write_text(json.dumps(summary))
        return folder

    return write


@pytest.fixture
def write_scores(tmp_path):
    """Writes the scores of the runs of a sequence: a list of lines for each run; returns the raw folder."""

    def write(study, sequence, runs):
        for run, lines in enumerate(runs):
            folder = tmp_path / "raw" / sequence / f"run_{run}"
            folder.mkdir(parents=True)
            table = pd.DataFrame(lines, columns=odometry_scores.columns_of(study))
            table.to_csv(folder / "scores.csv", index=False)
        return tmp_path / "raw"

    return write


def way(times_s):
    """A curve in space, over time."""
    t = times_s - TIMES_S[0]
    return np.stack([t, t**2, 0.2 * np.sin(5 * t)], axis=1)


@pytest.fixture
def sequence(tmp_path):
    """Ground truth in EuRoC's layout, at other times than the images'."""
    folder = tmp_path / "suite" / "V1_02_medium"
    truth = folder / "mav0" / "state_groundtruth_estimate0"
    truth.mkdir(parents=True)
    times_s = TIMES_S[0] + 0.005 * np.arange(-3, 230)
    places = way(times_s) @ TURN.T + STEP
    rows = [
        f"{round(t * 1e9)},{x},{y},{z},1,0,0,0,0,0,0\n" for t, (x, y, z) in zip(times_s, places)
    ]
    (truth / "data.csv").write_text("#timestamp, position, rotation, velocity\n" + "".join(rows))
    return folder
