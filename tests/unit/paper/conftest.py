"""Small raw scores whose tables can be worked out by hand."""

import itertools

import pytest

from sgf_paper import config
from sgf_paper.config import Column, Dataset, Grid, Sweep, Table, TableBlock, Tuning

HEADER = (
    "dataset,scene,region,matcher,column,window,uniqueness,truth_px,matched_px,"
    "mean_px,bad1_pct,bad2_pct,bad4_pct,d1_pct,invalid_pct,seconds\n"
)


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
    monkeypatch.setattr(config, "EXPERIMENTS", tmp_path)
    return tmp_path


@pytest.fixture
def datasets(tmp_path):
    return {"toys": Dataset("toys", tmp_path / "toys", 3)}
