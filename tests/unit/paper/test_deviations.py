"""Rows of tables refer to entries of docs/deviations.md that are there."""

import re

import pytest

from sgf_paper import config, deviations, paths
from sgf_paper.strict_yaml import ConfigError, read_yaml

DOCUMENT = """# Deviations

## First

| choice | the paper | here | why |
|---|---|---|---|
| <a id="first-one"></a>`one` | – | 1 | |
| <a id="first-two"></a>two | "| a |" | 2 | reasons |

## Prose

Nothing to refer to.

## Last

| what | the paper | here | why |
|---|---|---|---|
| <a id="last"></a>end | a | b | c |
"""


@pytest.fixture
def document(tmp_path):
    path = tmp_path / "deviations.md"
    path.write_text(DOCUMENT)
    return path


def load(document, text):
    file = document.with_suffix(".yaml")
    file.write_text(text)
    return deviations.load_deviations(file, document)


def test_entries_are_the_lines_of_the_tables(document):
    first, last = deviations.read_chapters(document)
    assert (first.title, last.title) == ("First", "Last")
    assert [(entry.key, entry.choice, entry.why) for entry in first.entries] == [
        ("first-one", "`one`", ""), ("first-two", "two", "reasons"),
    ]  # fmt: skip
    assert last.entries[0].here == "b"


@pytest.mark.parametrize(
    "old, new",
    [('<a id="last"></a>', ""), ('"last"', '"first-one"'), (" | b | c |", " | b |"), ('"last"', '"Last One"')],
)
def test_a_line_that_cannot_be_referred_to_is_named(document, old, new):
    document.write_text(DOCUMENT.replace(old, new))
    with pytest.raises(ConfigError, match=r"deviations.md:18: expected an anchor that is new and four cells"):
        deviations.read_chapters(document)


def test_rows_have_numbers_and_the_legend_what_was_used(document):
    notes = load(document, "table: {all: [last], row: [first-two, first-one]}\n")
    assert notes("table", "row") == [(1, "first-one"), (2, "first-two")]
    assert notes.legend == [(1, "first-one"), (2, "first-two")]
    assert notes("table") == [(3, "last")]
    assert notes("table", "other") == notes("other", "row") == []
    assert notes.legend[-1] == (3, "last")


def test_a_key_without_an_entry_is_named(document):
    with pytest.raises(ConfigError, match=r"deviations.yaml: table.row: .*deviations.md has no entry 'nothing'"):
        load(document, "table: {row: [last, nothing]}\n")


def columns_of(group):
    """Columns of a sweep or an experiment; none where it has none."""
    if (paths.SWEEPS / f"{group}.yaml").exists():
        return set(read_yaml(paths.SWEEPS / f"{group}.yaml")["columns"])
    return set(read_yaml(paths.EXPERIMENTS / f"{group}.yaml").get("columns", ()))


def test_the_projects_rows_are_columns_and_every_entry_is_referred_to():
    notes = deviations.load_deviations()
    for group, rows in notes.groups.items():
        assert set(rows) - {deviations.ALL} <= columns_of(group), group
    used = {key for rows in notes.groups.values() for keys in rows.values() for key in keys}
    assert used == set(notes.numbers)


def test_all_anchors_of_the_document_are_unique():
    anchors = re.findall(r'<a id="([^"]*)"', paths.DEVIATIONS_TEXT.read_text())
    assert len(anchors) == len(set(anchors)) == len(deviations.load_deviations().numbers)


def test_every_row_of_the_papers_stereo_tables_is_told_of():
    groups = deviations.load_deviations().groups
    for name in ("table1", "table2"):
        for sweep in config.load_experiment(name).sweeps:
            silent = set(sweep.main_columns) - set(groups[sweep.name])
            assert silent == ({"orig"} if sweep.matcher == "stereo_sgm" else set())  # cv::StereoSGBM as it is
