"""Reading of experiments: what is in the project is sound, and mistakes are named."""

import pytest
import yaml

from sgf_paper import config
from sgf_paper.config import ConfigError, Dataset

NAMES = sorted(path.stem for path in config.EXPERIMENTS.glob("*.yaml"))
TABLE1 = yaml.safe_load((config.EXPERIMENTS / "table1.yaml").read_text())


@pytest.mark.parametrize("name", NAMES)
def test_every_experiment_is_read_and_named_after_its_file(name):
    assert config.load_experiment(name).name == name


def test_columns_of_the_paper_come_first_and_in_its_order():
    for table in config.load_experiments("table").values():
        sweep = config.load_sweep(table.sweep)
        published = config.load_published(table, sweep.matcher)["mean_px"]
        assert sweep.main_columns == list(published) == list(sweep.columns)[: len(published)]


def test_published_values_are_the_papers():
    table = config.load_experiment("table1")
    published = config.load_published(table, "stereo_bm")
    assert published["mean_px"]["sgf"] == 3.29
    assert published["invalid_pct"]["orig"] == 40.44


def test_own_parameters_replace_the_shared_ones():
    table = config.load_experiment("table1")
    assert table.parameters("sgf").uniqueness == table.fixed["uniqueness"]
    assert table.parameters("orig").uniqueness == table.fixed_of["orig"]["uniqueness"]
    assert table.parameters("orig").window == table.fixed["window"]


def test_options_shared_by_our_matcher_do_not_reach_opencv(sweep):
    assert sweep.column_options("sgf") == {"left_right_max": 1, "metric": "sgf"}
    assert sweep.column_options("orig") == {}


def change(**changes):
    return {**TABLE1, **changes}


@pytest.mark.parametrize(
    "node, message",
    [
        (change(colour="red"), "unknown key 'colour'"),
        ({k: v for k, v in TABLE1.items() if k != "sweep"}, "key 'sweep' is missing"),
        (change(kind="chart"), "kind is 'chart'"),
        (change(fixed={"window": 10, "uniqueness": 10}), "window 10 is not on the sweep's grid"),
        (change(fixed={"window": 9, "uniqueness": 11}), "uniqueness 11 is not on the sweep's grid"),
        (change(tuning={"objective": "bad2_pct"}), "tuning: key 'kept_pct' is missing"),
        (change(sweep="nowhere"), "nowhere.yaml: cannot be read"),
        ([1, 2], "expected a map"),
    ],
)
def test_mistakes_are_named_with_their_file(experiments, node, message):
    (experiments / "bad.yaml").write_text(yaml.safe_dump(node))
    with pytest.raises(ConfigError, match=message):
        config.load_experiment("bad")


def test_unreadable_yaml_names_its_file(experiments):
    (experiments / "bad.yaml").write_text("a: [1")
    with pytest.raises(ConfigError, match="bad.yaml"):
        config.load_experiment("bad")


def test_an_unknown_published_entry_is_an_error(table):
    table.published = "table_7"
    with pytest.raises(ConfigError, match="no entry table_7.stereo_bm"):
        config.load_published(table, "stereo_bm")


def test_listing_of_datasets(tmp_path):
    listing = tmp_path / "datasets.tsv"
    listing.write_text("a\t/data/with blank/a\t3\nb\t/data/b\t11\n")
    found = config.read_datasets(listing)
    assert [(d.name, str(d.folder), d.scenes) for d in found.values()] == [
        ("a", "/data/with blank/a", 3),
        ("b", "/data/b", 11),
    ]


def test_a_figure_takes_the_first_group_at_hand_and_only_scenes_that_exist(tmp_path):
    figure = config.load_experiment("fig4")
    left = tmp_path / "debian_pairs" / "Motorcycle" / "im0.png"
    left.parent.mkdir(parents=True)
    left.touch()
    datasets = {"debian_pairs": Dataset("debian_pairs", tmp_path / "debian_pairs", 1)}
    group = figure.group(datasets)
    assert (group.dataset, [scene.name for scene in group.scenes]) == ("debian_pairs", ["Motorcycle"])
    left.unlink()
    assert figure.group(datasets) is None
