"""Reading of experiments: what is in the project is sound, and mistakes are named."""

from pathlib import Path

import pytest
import yaml

from sgf_paper import config, paths, run, summary
from sgf_paper.experiment import Experiment
from sgf_paper.stereo_config import load_published
from sgf_paper.stereo_datasets import Dataset, read_datasets
from sgf_paper.strict_yaml import ConfigError, read_yaml

NAMES = sorted(path.stem for path in paths.EXPERIMENTS.glob("*.yaml"))
TABLE1 = yaml.safe_load((paths.EXPERIMENTS / "table1.yaml").read_text())


@pytest.mark.parametrize("name", NAMES)
def test_every_experiment_is_read_and_named_after_its_file(name):
    assert config.load_experiment(name).name == name


@pytest.mark.parametrize("name", NAMES)
def test_an_experiment_is_made_when_a_file_that_it_makes_is_there(name):
    stage = config.load_experiment(name)
    kind = config.KINDS[stage.kind]
    main = str(summary.main_file(stage, Path()))
    assert main in kind.files(name) or main in kind.others.format(name=name, folder="").split(", ")


def test_a_new_kind_is_one_line_for_loader_run_and_summary(experiments, monkeypatch):
    monkeypatch.setitem(config.KINDS, "toy", config.Kind(Experiment, (".csv", "_more.csv", ".md"), (".png", ".pdf")))
    (experiments / "new.yaml").write_text("{kind: toy, name: new, title: A toy}")
    stage = config.load_experiment("new")
    assert run.obstacle(stage, {}, experiments) == ""
    assert summary.stage_lines(stage, experiments, 0) == ["  new            NOT MADE"]
    (experiments / "tables").mkdir()
    (experiments / "tables" / "new.csv").touch()
    said = "figures/new.png (.pdf), tables/new.md (.csv, _more.csv)"
    assert summary.stage_lines(stage, experiments, 0) == [f"  new            made        {said}"]


@pytest.mark.parametrize("name", ["table1", "density", "fig4", "light_change", "bench_stereo"])
def test_what_is_not_rendered_needs_a_data_set(name, tmp_path):
    stage = config.load_experiment(name)
    assert run.obstacle(stage, {}, tmp_path) == "its data are not at hand"
    pair = tmp_path / "Motorcycle"
    pair.mkdir()
    (pair / "im0.png").touch()
    datasets = {"debian_pairs": Dataset("debian_pairs", tmp_path, 1)}
    assert run.obstacle(stage, datasets, tmp_path) == ""


def test_columns_of_the_paper_come_first_and_in_its_order():
    for table in config.load_experiments("table").values():
        paper = list(load_published(table, "stereo_bm")["mean_px"])
        for sweep in table.sweeps:
            assert sweep.main_columns == paper == list(sweep.columns)[: len(paper)]


@pytest.mark.parametrize("name", ["table1", "table2"])
def test_tables_have_the_papers_two_matchers_and_semi_global_matching(name):
    table = config.load_experiment(name)
    blocks = {block.sweep.matcher: block.published for block in table.blocks}
    assert blocks == {"stereo_bm": "stereo_bm", "stereo_mesh": "mesh_stereo", "stereo_sgm": ""}
    assert [block.sweep.name for block in table.curve_blocks] == ["stereo_bm", "stereo_sgm"]


def test_published_values_are_the_papers():
    table = config.load_experiment("table1")
    published = load_published(table, "stereo_bm")
    assert published["mean_px"]["sgf"] == 3.29
    assert published["invalid_pct"]["orig"] == 40.44
    assert load_published(table, "mesh_stereo")["bad4_pct"]["sgf"] == 12.53
    assert load_published(table, "") == {}


def test_own_parameters_replace_the_shared_ones():
    block = config.load_experiment("table1").block("stereo_bm")
    assert block.parameters("sgf").uniqueness == block.fixed["uniqueness"]
    assert block.parameters("orig").uniqueness == block.fixed_of["orig"]["uniqueness"]
    assert block.parameters("orig").window == block.fixed["window"]


def test_options_shared_by_our_matcher_do_not_reach_opencv(sweep):
    assert sweep.column_options("sgf") == {"left_right_max": 1, "metric": "sgf"}
    assert sweep.column_options("orig") == {}


def change(**changes):
    return {**TABLE1, **changes}


def change_block(**changes):
    first, *others = TABLE1["blocks"]
    return change(blocks=[{**first, **changes}, *others])


@pytest.mark.parametrize(
    "node, message",
    [
        (change(colour="red"), "unknown key 'colour'"),
        ({k: v for k, v in TABLE1.items() if k != "blocks"}, "key 'blocks' is missing"),
        (change_block(colour="red"), r"blocks\[0\]: unknown key 'colour'"),
        (change(kind="chart"), "kind is 'chart'"),
        (change_block(fixed={"window": 10, "uniqueness": 10}), "window 10 is not on the sweep's grid"),
        (change_block(fixed={"window": 9, "uniqueness": 11}), "uniqueness 11 is not on the sweep's grid"),
        (change_block(tuning={"objective": "bad2_pct"}), "tuning: key 'kept_pct' is missing"),
        (change_block(fixed_of={"orig": {"widow": 9}}), "fixed, of orig: unknown key 'widow'"),
        (change_block(fixed_of={"sdf": {"window": 9}}), r"fixed_of: no column \['sdf'\] in sweep stereo_bm"),
        (change_block(sweep="nowhere"), "nowhere.yaml: cannot be read"),
        (change_block(sweep=["stereo_bm"]), r"bad.yaml: blocks\[0\].sweep: expected str, found \['stereo_bm'\]"),
        (change_block(tuning="best"), r"bad.yaml: blocks\[0\].tuning: expected a map, found 'best'"),
        (change_block(tuning={"objective": "x", "kept_pct": "all"}), "tuning.kept_pct: expected float, found 'all'"),
        (change(title=7), "bad.yaml: title: expected str, found 7"),
        (change(datasets="all"), "bad.yaml: datasets: expected a list, found 'all'"),
        (change(near_duplicates=[["a", 1]]), r"bad.yaml: near_duplicates\[0\]\[1\]: expected str, found 1"),
        (change(blocks={}), "bad.yaml: blocks: expected a list, found {}"),
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
        load_published(table, "stereo_bm")


def test_listing_of_datasets(tmp_path):
    listing = tmp_path / "datasets.tsv"
    listing.write_text("a\t/data/with blank/a\t3\nb\t/data/b\t11\n")
    found = read_datasets(listing)
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


def test_a_figure_of_a_sweep_that_its_table_lacks_is_an_error(table):
    with pytest.raises(ConfigError, match="table9 has no block of sweep stereo_sgm"):
        table.block("stereo_sgm")


NINE_OF_EACH = "\n".join(f"{b}: &{b} [{', '.join(9 * ['*' + a])}]" for a, b in zip("abcdefgh", "bcdefghi"))


@pytest.mark.parametrize(
    "text, message",
    [
        ("a: [", "while parsing"),
        (f"a: &a [1]\n{NINE_OF_EACH}", "its aliases make more than 1000000 values"),
        ("a: &a [*a]", "its aliases make more than"),
        ("a: " + 100_000 * "[" + 100_000 * "]", "line 1: nested more than 50 deep"),
        ("a: 2001-13-45", "month must be in"),
        ("a: !!bool x", "'x'"),
        ("a: !!int ''", "index out of range"),
        ("a: !!timestamp x", "NoneType"),
        ("a: \0", "unacceptable character"),
        ("7", "expected a map"),
        ("", "expected a map"),
    ],
)  # fmt: skip
def test_a_text_that_is_no_yaml_is_an_error_with_its_file(tmp_path, text, message):
    file = tmp_path / "text.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match="text.yaml: ") as error:
        read_yaml(file)
    assert message in str(error.value)


def test_bytes_that_are_no_text_are_an_error(tmp_path):
    (tmp_path / "text.yaml").write_bytes(b"a: \xff")
    with pytest.raises(ConfigError, match="text.yaml: .*can't decode"):
        read_yaml(tmp_path / "text.yaml")
