"""The catalogue of data sets: strict reading, the project's own entries, and what experiments need of them."""

import pytest
import yaml

from sgf_paper import catalog, paths
from sgf_paper.strict_yaml import ConfigError, read_yaml

VALID = {
    "archives": {"a.zip": {"urls": ["https://example.org/a.zip"], "bytes": 7}, "hand.zip": {}},
    "publishers": {"we": {"home": "https://example.org", "licence": "CC0"}},
    "datasets": {
        "a": {"title": "A", "publisher": "we", "folder": "us/a", "ways": [[{"archive": "a.zip"}]]},
        "b": {"title": "B", "publisher": "we", "folder": "us/b", "by_hand": "ask us"},
    },
    "groups": {"both": ["a", "b"]},
}


def load(tmp_path, change=lambda node: None):
    node = yaml.safe_load(yaml.safe_dump(VALID))
    change(node)
    file = tmp_path / "catalog.yaml"
    file.write_text(yaml.safe_dump(node))
    return catalog.load_catalog(file)


def change(*keys, value):
    def apply(node):
        for key in keys[:-1]:
            node = node[key]
        node[keys[-1]] = value

    return apply


def test_entries_and_groups(tmp_path):
    read = load(tmp_path)
    assert read.archives["a.zip"].expected_bytes == 7
    assert read.datasets["a"].publisher.licence == "CC0"
    assert read.datasets["a"].archives == ["a.zip"] and read.datasets["b"].archives == []
    assert read.expand(["b", "both", "a"]) == ["b", "a"]


@pytest.mark.parametrize(
    "keys, value, message",
    [
        (("archives", "a.zip", "urls"), ["file:///etc/passwd"], "neither http:// nor https://"),
        (("archives", "a.zip", "urls"), ["ftp://example.org/a.zip"], "neither http:// nor https://"),
        (("archives", "a.zip", "sha256"), "12", "archives.a.zip: sha256 is not 64"),
        (("archives", "a.zip", "md5"), "g" * 32, "md5 is not 32"),
        (("archives", "a.zip", "md5"), 7, "archives.a.zip.md5: expected str, found 7"),
        (("archives", "a.zip", "size"), 1, "unknown key 'size'"),
        (("archives", "a.zip", "bytes"), [7], "archives.a.zip.bytes: expected int, found [7]"),
        (("archives", "a.zip", "bytes"), True, "archives.a.zip.bytes: expected int, found True"),
        (("archives", "a.zip", "bytes"), -7, "archives.a.zip: a number of bytes is negative"),
        (("archives", "a.zip", "about_bytes"), 10**400, "archives.a.zip: a number of bytes is negative or beyond"),
        (("archives", "a.zip", "urls"), "https://example.org", "archives.a.zip.urls: expected a list, found"),
        (("archives",), ["a.zip"], "archives: expected a map, found ['a.zip']"),
        (("archives", 7), {}, "archives: a key: expected str, found 7"),
        (("archives", "../a.zip"), {}, "'../a.zip' is not a plain file name"),
        (("archives", "lock"), {}, "archives.lock: the name ends in none of .zip, .tar"),
        (("archives", "a" * 200 + ".zip"), {}, "is longer than 200 bytes"),
        (("archives", "a.zip", "sha256"), "A" * 64, "hexadecimal digits in lower case"),
        (("datasets", "a", "folder"), "../a", "'../a' leads out"),
        (("datasets", "a", "folder"), "/a", "'/a' leads out"),
        (("datasets", "a", "folder"), "", "datasets.a: folder '' is not a plain one below the data folder"),
        (("datasets", "a", "folder"), "./", "folder './' is not a plain one"),
        (("datasets", "a", "folder"), ".sgf-fetch", "folder '.sgf-fetch' is not a plain one"),
        (("datasets", "a", "folder"), "us/" + "ä" * 101, "is longer than 200 bytes"),
        (("datasets", "a", "folder"), "us/b/", "datasets.b: its folder is, or lies in, that of 'a'"),
        (("datasets", "a", "folder"), "us", "datasets.b: its folder is, or lies in, that of 'a'"),
        (("datasets", "a", "holds"), ["x/../../y"], "leads out"),
        (("datasets", "a", "folder"), "a\0b", "leads out"),
        (("datasets", "a", "holds"), ["x", 1], "datasets.a.holds[1]: expected str, found 1"),
        (("datasets", "../a"), {}, "'../a' is not a plain file name"),
        (("datasets", "a"), "x", "datasets.a: expected a map, found 'x'"),
        (("datasets", "a", "unpacked_bytes"), -1, "datasets.a: a number of bytes is negative"),
        (("datasets", "a", "publisher"), ["we"], "publisher is ['we']; known: we"),
        (("datasets", "a", "ways"), [{"archive": "a.zip"}], "datasets.a.ways[0]: expected a list"),
        (("datasets", "a", "ways"), [[{"archive": ["a.zip"]}]], "datasets.a.ways[0][0].archive: expected str"),
        (("datasets", "a", "publisher"), "they", "publisher is 'they'; known: we"),
        (("datasets", "a", "ways"), [[{"archive": "c.zip"}]], "datasets.a: no archive 'c.zip'"),
        (("datasets", "a", "ways"), [[{"archive": "hand.zip"}]], "'hand.zip' has no urls"),
        (("datasets", "a", "ways"), [[{"archive": "a.zip", "to": "/etc"}]], "'/etc' leads out"),
        (("datasets", "a", "ways"), [], "has neither ways nor by_hand"),
        (("datasets", "b", "ways"), [[]], "datasets.b.ways: one has no pieces"),
        (("groups", "both"), ["a", "c"], "groups.both: no data set 'c'"),
        (("groups", "both"), [], "groups.both: names no data set"),
        (("groups", "both"), "a", "groups.both: expected a list, found 'a'"),
        (("groups", "a"), ["b"], "a data set has this name"),
        (("extra",), {}, "expected archives, publishers"),
        ((7,), {}, "expected archives, publishers"),
    ],
)
def test_what_is_wrong_is_named_with_its_file(tmp_path, keys, value, message):
    with pytest.raises(ConfigError, match="catalog.yaml") as error:
        load(tmp_path, change(*keys, value=value))
    assert message in str(error.value)


def test_an_unknown_name_is_said_with_those_that_are_known(tmp_path):
    with pytest.raises(ConfigError, match="unknown data set 'c'; known: both, a, b"):
        load(tmp_path).expand(["a", "c"])


def test_an_experiment_may_hold_long_texts(tmp_path, experiments):
    (experiments / "first.yaml").write_text(f"title: {'a' * 300}\nlike: second\n")
    (experiments / "second.yaml").write_text("like: first\nfile: us/a/x.png\n")
    assert catalog.needed_by(["first"], load(tmp_path)) == ["a"]


# ---- The project's own catalogue


@pytest.fixture(scope="module")
def own():
    return catalog.load_catalog()


def test_every_stereo_data_set_has_an_entry_that_unpacks_to_where_it_is_looked_for(own):
    for name, layout in read_yaml(paths.STEREO_LAYOUTS).items():
        assert own.datasets[name].folder == layout["folders"][0], name


def test_every_data_set_has_licence_home_and_citation(own):
    for name, source in own.datasets.items():
        assert source.publisher.licence and source.publisher.home, name
        assert source.citation or source.publisher.citation, name


def test_no_two_data_sets_share_a_folder_and_every_archive_is_used(own):
    folders = [source.folder for source in own.datasets.values()]
    assert len(set(folders)) == len(folders)
    used = {archive for source in own.datasets.values() for archive in source.archives}
    assert used == set(own.archives)


def test_the_eleven_sequences_come_from_the_research_collection_first(own):
    assert len(own.groups["euroc"]) == 11
    for name in own.groups["euroc"]:
        source = own.datasets[name]
        first = own.archives[source.ways[0][0].archive]
        assert "research-collection.ethz.ch" in first.urls[0] and first.md5 and first.bytes
        assert source.ways[0][0].inside == f"{name.removeprefix('euroc_')}.zip"
        assert source.folder == f"euroc/{name.removeprefix('euroc_')}"


def test_experiments_name_what_is_fetched_for_them(own):
    assert catalog.needed_by(["table1"], own) == ["middlebury2014_q", "middlebury2014_h"]
    assert catalog.needed_by(["fig1"], own) == ["icl_nuim_lr_kt2"]
    assert catalog.needed_by(["table3"], own) == own.groups["euroc"]  # through the tables that it joins
    assert catalog.needed_by(["scenes"], own) == []
    every = [path.stem for path in paths.EXPERIMENTS.glob("*.yaml")]
    assert set(catalog.needed_by(every, own)) == {*own.groups["paper"], "middlebury2014_q"}
