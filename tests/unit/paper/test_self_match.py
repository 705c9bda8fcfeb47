"""Fig. 1: which frames are run, what stands in the tables, what is drawn."""

import copy
import itertools

import numpy as np
import pytest
import yaml
from PIL import Image

from sgf_paper import config, paths, self_match, summary
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.study_config import Frame, load_published_errors

FIG1 = yaml.safe_load((paths.EXPERIMENTS / "fig1.yaml").read_text())
HEADER = (
    "image,change,value,column,first_disparity,end_disparity,pixels,mean_px,first_px,median_px,"
    "bad1_pct,ties_pct\n"
)
MEANS = {"photo": 8.0, "ugf": 4.0, "sgf": 1.0, "pm_truncated": 2.0}


@pytest.fixture
def figure(experiments):
    """Fig. 1 with fewer columns, cases and curves."""
    node = copy.deepcopy(FIG1)
    node["columns"] = {name: node["columns"][name] for name in MEANS}
    node["figure_columns"] = list(MEANS)
    node["cases"] = {name: node["cases"][name] for name in ("noise_free", "noisy")}
    node["curves"] = {"vignette": [0, 0.5], "noise": [0, 2]}
    (experiments / "fig1.yaml").write_text(yaml.safe_dump(node, sort_keys=False))
    return config.load_experiment("fig1")


def lines_of(figure, frame, offset):
    """What sgf_study writes; mean errors are round numbers plus `offset`."""
    for case, (first, end) in itertools.product(figure.cases, figure.matching["ranges"]):
        for column, mean in MEANS.items():
            value = mean + offset + (0.25 if case == "noisy" else 0) + (10 if first < 0 else 0)
            yield f"{frame},{case},,{column},{first},{end},500,{value},{value - 0.5},1,2,3\n"
    for change, values in figure.curves.items():
        for value, (column, mean) in itertools.product(values, MEANS.items()):
            error = mean * value + offset
            yield f"{frame},{change},{value},{column},0,20,500,{error},{error},1,2,3\n"


@pytest.fixture
def raw(figure, tmp_path):
    """Scores and pictures of the generated frames and of the paper's."""
    folder = tmp_path / "raw"
    for offset, frame in enumerate(["living_room_bookcases", "living_room_sofa", "icl_kt2_120", "icl_kt2_808"]):
        case = folder / frame / "noise_free"
        case.mkdir(parents=True)
        levels = np.full((12, 16), 30, dtype=np.uint8)
        levels[:, :3] = 255
        for name in ("left", "right", *figure.columns):
            Image.fromarray(levels).save(case / f"{name}.png")
        (folder / f"{frame}.csv").write_text(HEADER + "".join(lines_of(figure, frame, offset)))
    return folder


def test_groups_at_hand_and_their_stand_ins(figure, tmp_path):
    generated, data = tmp_path / "generated", tmp_path / "data"

    def add(*paths):
        for path in paths:
            (data / path).parent.mkdir(parents=True, exist_ok=True)
            (data / path).touch()

    def names():
        return [group.name for group in figure.present(str(data))]

    assert [g.name for g in figure.present("")] == ["living_room"]
    add("icl_nuim/living_room_kt0/rgb/1.png", "icl_nuim/living_room_kt0/rgb/5.png")
    assert names() == ["living_room", "icl_kt0"]
    add("icl_nuim/living_room_kt2/rgb/120.png")
    assert names() == ["living_room", "icl_kt0"], "one frame is not enough"
    add("icl_nuim/living_room_kt2/rgb/808.png")
    assert names() == ["living_room", "icl_kt2"]
    frames = figure.frames(generated, str(data))
    assert list(frames) == ["living_room_bookcases", "living_room_sofa", "icl_kt2_120", "icl_kt2_808"]
    assert frames["living_room_sofa"] == Frame(generated / "pairs/living_room_sofa/view.png", True)
    assert frames["icl_kt2_808"] == Frame(data / "icl_nuim/living_room_kt2/rgb/808.png", False)


def test_the_papers_values_stand_beside_its_own_frames_and_range_only(figure, raw):
    groups = self_match.groups_of(figure, [path.stem for path in raw.glob("*.csv")])
    assert [group.name for group in groups] == ["living_room", "icl_kt2"]
    table = self_match.case_table(figure, self_match.read_scores(figure, groups, raw))
    assert list(table.columns) == self_match.CASE_COLUMNS
    assert len(table) == 4 * 2 * 2 * len(MEANS)
    shown = table[table["published"].notna()]
    assert set(shown["group"]) == {"icl_kt2"} and set(shown["first_disparity"]) == {0}
    pairs = shown[shown["case"] == "noise_free"].set_index(["cost", "frame"])["published"]
    assert pairs["sgf", "120"] == 1.21 and pairs["sgf", "808"] == 0.18
    assert pairs["photo", "808"] == 7.76
    assert "pm_truncated" not in set(shown["cost"])


def test_tables_hold_what_was_measured(figure, raw, tmp_path):
    self_match.make_figure("fig1", raw, ["living_room_bookcases", "living_room_sofa"], tmp_path, tmp_path)
    document = (tmp_path / "fig1.md").read_text()
    assert "## synthetic living room (frames bookcases / sofa), noise_free, 500 pixels each" in document
    # mean, published, ties, first, median, bad 1, mean in the other range
    row = "| sgf | 1.00 / 2.00 | 1.21 / 0.18 | 3.0 / 3.0 | 0.50 / 1.50 | 1.0 / 1.0 | 2.0 / 2.0 | 11.00 / 12.00 |"
    assert row in document
    order = [line.split(" |")[0][2:] for line in document.splitlines() if line.startswith("| ")]
    assert order[:5] == ["cost", "sgf", "pm_truncated (extra)", "ugf", "photo"]
    assert "ICL" not in document.split("## ", 1)[1]
    for name in ("fig1.png", "fig1.pdf", "fig1_curves.png", "fig1_curves.pdf", "fig1_curves.csv"):
        assert (tmp_path / name).stat().st_size > 500
    lines = summary._self_match_lines(tmp_path / "fig1.csv")
    assert lines[0] == "living_room noise_free, mean px: sgf 1.50, ugf 4.50, photo 8.50"


def test_curves_are_means_over_the_frames(figure, raw):
    groups = self_match.groups_of(figure, ["living_room_bookcases", "living_room_sofa"])
    curves = self_match.curve_table(figure, self_match.read_scores(figure, groups, raw))
    assert len(curves) == 2 * 4 * len(MEANS)
    drawing = self_match.draw_curves(figure, groups[0], curves)
    axis = drawing.axes[0]
    lines = {line.get_label(): line.get_xydata().tolist() for line in axis.get_lines()}
    assert list(lines) == list(MEANS)
    assert lines["ugf"] == [[0.0, 0.5], [0.5, 2.5]]
    styles = {line.get_label(): (line.get_color(), line.get_linestyle()) for line in axis.get_lines()}
    assert styles["pm_truncated"] == (self_match.COLOURS["pm"], "--")
    assert len(set(styles.values())) == len(MEANS)


def test_the_figure_shows_images_and_errors_with_their_means(figure, raw):
    groups = self_match.groups_of(figure, ["living_room_bookcases", "living_room_sofa"])
    cases = self_match.case_table(figure, self_match.read_scores(figure, groups, raw))
    axes = self_match.draw(figure, groups[0], cases, raw).axes
    shown = [(axis.get_title(), axis.get_xlabel()) for axis in axes if axis.get_title()]
    assert shown[:3] == [("image", ""), ("photo", "8.00 px"), ("ugf", "4.00 px")]
    assert shown[3:6] == [("modified image", ""), ("sgf", "1.00 px"), ("pm_truncated", "2.00 px")]
    assert shown[6:8] == [("image", ""), ("photo", "9.00 px")]
    errors = axes[1].get_images()[0].get_array()
    assert np.isnan(np.ma.filled(errors, np.nan)[0, 0]) and errors[5, 9] == 3


def test_columns_are_the_papers_in_its_order():
    published = load_published_errors(config.load_experiment("fig1"))
    columns = [name for name, c in config.load_experiment("fig1").columns.items() if not c.extra]
    assert columns == list(published)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"figure_case": "foggy"}, "figure_case 'foggy' is not among the cases"),
        ({"figure_columns": ["sgf", "sdf"]}, r"figure_columns: no column \['sdf'\]"),
        ({"published_group": "nobody"}, r"no group \['nobody'\]"),
        ({"columns": {"sgf": {"metrics": "sgf"}}}, "columns.sgf: unknown key 'metrics'"),
        ({"groups": [{"name": "a", "title": "A"}]}, r"groups\[0\]: key 'frames' is missing"),
    ],
)
def test_mistakes_are_named(experiments, changes, message):
    (experiments / "bad.yaml").write_text(yaml.safe_dump({**FIG1, **changes}))
    with pytest.raises(ConfigError, match=message):
        config.load_experiment("bad")


def test_an_unknown_published_entry_is_an_error(figure):
    figure.published = "figure_9"
    with pytest.raises(ConfigError, match="no entry figure_9"):
        load_published_errors(figure)
