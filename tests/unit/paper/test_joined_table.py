"""Table III whole: which lines there are, what stands beside what, and why a cell is empty."""

import math

import pandas as pd
import pytest
import yaml
from matplotlib import pyplot

from sgf_paper import config, deviations, joined_table, paths, summary
from sgf_paper.strict_yaml import ConfigError

NODE = yaml.safe_load((paths.EXPERIMENTS / "table3.yaml").read_text())
REFERENCE = paths.PROJECT / "results" / "reference"
EXTERNAL = ["okvis", "slam"]


@pytest.fixture
def joined():
    return config.load_experiment("table3")


@pytest.mark.parametrize(
    "change, message",
    [
        ({"parts": {"a": "odometry"}}, "parts.a: odometry is no trajectory_table"),
        ({"parts": {"a": ["table3_dso"]}}, "parts.a: expected str, found"),
        ({"parts": {}}, "parts: there are none"),
        ({"published": ["okvis", "vins"]}, r"published: the paper has no row \['vins'\]"),
        ({"parts": {"a": "gone"}}, "gone.yaml: cannot be read"),
    ],
)
def test_mistakes_are_named(monkeypatch, tmp_path, change, message):
    for path in paths.EXPERIMENTS.glob("*.yaml"):
        (tmp_path / path.name).write_text(path.read_text())
    monkeypatch.setattr(paths, "EXPERIMENTS", tmp_path)
    (tmp_path / "bad.yaml").write_text(yaml.safe_dump({**NODE, **change}))
    with pytest.raises(ConfigError, match=message):
        config.load_experiment("bad")


def test_parts_have_one_rule_of_failure(monkeypatch, tmp_path):
    for path in paths.EXPERIMENTS.glob("table3*.yaml"):
        (tmp_path / path.name).write_text(
            path.read_text().replace("lost_below_pct: 95", "lost_below_pct: 90", 1)
        )
    (tmp_path / "table3_dso.yaml").write_text((paths.EXPERIMENTS / "table3_dso.yaml").read_text())
    monkeypatch.setattr(paths, "EXPERIMENTS", tmp_path)
    with pytest.raises(ConfigError, match="lost_below_pct of table3_vio differs from that of table3_dso"):
        config.load_experiment("table3")


def part_line(sequence, column, condition="undisturbed", mean=50.0, rmse=60.0, success=4):
    return {
        "sequence": sequence, "condition": condition, "column": column, "runs": 4, "success_scale": success,
        "posed_pct": 99.5, "ate_mm": rmse, "ate_mean_of_successes_mm": mean, "rpe_one_second_mm": 5.0,
    }  # fmt: skip


@pytest.fixture
def tables():
    """Lines of the parts: two whole sequences of EuRoC, a cut, and a rendered one."""
    nothing = {"mean": math.nan, "rmse": math.inf, "success": 0}
    dso = [
        part_line("MH_01_easy", "photo"),
        part_line("MH_01_easy", "photo", "light", **nothing),
        part_line("euroc_MH_01", "sgf", mean=71.0),
    ]
    vio = [
        part_line("MH_01_easy", "lssd", mean=2.0, success=3),
        part_line("MH_01_easy", "lssd", "light"),
        part_line("euroc_MH_01_cut", "ngv"),
        part_line("euroc_MH_01", "lssd", mean=80.0),
        part_line("euroc_V2_03", "lssd", mean=900.0),
        part_line("euroc_V2_03", "ngv", **nothing),
    ]
    return {"dso": pd.DataFrame(dso), "vio": pd.DataFrame(vio)}


@pytest.fixture
def scores(joined, tmp_path):
    """Scores of other systems: one good, one that lost its way, one with too few poses."""

    def write(system, dataset, sequence, **changed):
        path = tmp_path / f"{system}_{sequence}.csv"
        line = {
            "system": system, "dataset": dataset, "sequence": sequence, "path_m": 10, "ate_mean_m": 0.1,
            "ate_rmse_m": 0.11, "rpe_one_second.translation_m": 0.01, "coverage_pct": 99, "success_by_scale": True,
        }  # fmt: skip
        pd.DataFrame([line | changed]).to_csv(path, index=False)
        return path

    return [
        write("okvis", "euroc", "MH_01_easy"),
        write("slam", "euroc", "V2_03_difficult", ate_rmse_m=0.21),
        write("slam", "synthetic", "MH_01_easy", coverage_pct=94),
        write("slam", "synthetic", "MH_03_medium", success_by_scale=False),
    ]


@pytest.fixture
def systems(joined):
    return joined_table.list_systems(joined, EXTERNAL)


@pytest.fixture
def lines(joined, systems, tables, scores):
    return joined_table.make_lines(joined, systems, tables, joined_table.read_external(joined, scores))


def test_systems_come_as_in_the_paper_then_those_beyond_it_then_others(systems):
    names = [system.name for system in systems]
    assert names[:4] == [
        "orb_slam2",
        "svo2",
        "dso",
        "basalt",
    ], "okvis has been run, so it is no row of the paper alone"
    assert names[4:12] == ["dso_photo", "dso_sgf", *(f"vio_{c}" for c in "lssd gm gn sgf sgf2 sgf3".split())]
    assert names[12:16] == ["dso_ngv_motion", "vio_ngv", "vio_sgv", "vio_sgf3_vec"]
    assert names[-2:] == ["okvis", "slam"]
    published = {system.name: system.published for system in systems}
    assert published["dso_photo"] == "dso" and published["vio_sgf3"] == "basalt_sgf3"
    assert published["okvis"] == "okvis" and published["slam"] == published["vio_ngv"] == ""


def test_published_values_are_those_of_euroc_and_of_the_mean_error(lines):
    published = lines.dropna(subset="published")
    assert set(published["dataset"]) == {"euroc"} and set(published["quantity"]) == {"ate_mean_m"}
    assert "V2_03_difficult" not in set(published["sequence"])
    assert published.groupby("system").size().eq(10).all() and published["system"].nunique() == 5 + 8
    only = published[published["system"].isin(["orb_slam2", "svo2", "dso", "basalt"])]
    assert only["measured"].isna().all() and only["runs"].eq(0).all()
    assert not lines.duplicated(joined_table.KEYS).any()


def value(lines, *key, field="measured"):
    own = lines[lines["condition"] == "undisturbed"]
    return own.set_index(["dataset", "sequence", "system", "quantity"]).sort_index().loc[key, field]


def test_measured_stands_beside_published_under_euroc_s_names(lines):
    key = ("euroc", "MH_01_easy", "vio_lssd", "ate_mean_m")
    assert [value(lines, *key, field=field) for field in ("measured", "published", "runs")] == [
        0.08,
        0.076,
        4,
    ]
    assert value(lines, "euroc", "MH_01_easy", "dso_sgf", "ate_mean_m", field="published") == 0.071
    assert value(lines, "euroc", "MH_02_easy", "vio_lssd", "ate_mean_m", field="runs") == 0
    assert value(lines, "euroc_slice", "MH_01_easy", "vio_ngv", "ate_rmse_m") == 0.06
    assert value(lines, "synthetic", "MH_01_easy", "vio_lssd", "success_pct") == 75
    assert value(lines, "synthetic", "MH_01_easy", "vio_lssd", "coverage_pct") == 99.5
    assert value(lines, "synthetic", "MH_01_easy", "vio_lssd", "rpe_1s_m") == 0.005
    assert list(lines["dataset"].unique()) == ["euroc", "euroc_slice", "synthetic"]
    assert list(lines["condition"].unique()) == ["undisturbed", "dso_light", "vio_light"]
    assert list(lines.loc[lines["dataset"] == "euroc", "sequence"].unique())[::10] == [
        "MH_01_easy",
        "V2_03_difficult",
    ]


def test_other_systems_fail_by_the_rule_for_ours(lines):
    good = [value(lines, "euroc", "MH_01_easy", "okvis", name) for name in joined_table.MEASURED]
    assert good == [0.1, 0.11, 0.01, 99, 100]
    assert value(lines, "euroc", "MH_01_easy", "okvis", "ate_mean_m", field="published") == 0.085
    for where in (("euroc", "V2_03_difficult"), ("synthetic", "MH_01_easy"), ("synthetic", "MH_03_medium")):
        failed = [value(lines, *where, "slam", name) for name in joined_table.MEASURED]
        assert math.isnan(failed[0]) and failed[1:3] == [math.inf, math.inf] and failed[-1] == 0


def test_files_hold_what_is_asked_for(lines, tmp_path):
    joined_table.write_lines(lines, tmp_path, "table3")
    text = (tmp_path / "table3.csv").read_text().splitlines()
    assert text[0] == "dataset,sequence,system,quantity,measured,published,runs"
    assert "euroc,MH_01_easy,basalt,ate_mean_m,,0.076,0" in text
    assert "euroc,MH_01_easy,vio_lssd,ate_mean_m,0.080000,0.076,4" in text
    assert "euroc,V2_03_difficult,vio_ngv,ate_rmse_m,inf,,4" in text
    assert "euroc,V2_03_difficult,vio_ngv,ate_mean_m,,,4" in text
    light = (tmp_path / "table3_light.csv").read_text().splitlines()
    assert light[0] == "condition," + text[0] and len(light) == 1 + 2 * 5
    assert "dso_light,synthetic,MH_01_easy,dso_photo,success_pct,0.00,,4" in light


def cells_of(blocks, title, label):
    block = next(block for block in blocks if block["title"] == title)
    row = next(row for row in block["rows"] if row["label"] == label)
    names = [*block["sequences"], "average", "success", "coverage"]
    return {
        name: f"{cell.shown} {cell.reason}".strip() for name, cell in zip(names, row["cells"], strict=True)
    }


def test_every_empty_cell_has_its_reason(joined, systems, lines):
    blocks = joined_table.make_blocks(joined, systems, lines)
    titles = ["euroc, undisturbed", "euroc_slice, undisturbed", "synthetic, undisturbed"]
    assert [block["title"] for block in blocks] == [*titles, "synthetic, dso_light", "synthetic, vio_light"]
    for block in blocks:
        cells = [cell for row in block["rows"] for cell in row["cells"]]
        assert all(bool(cell.reason) == (cell.shown[0] in "–(") for cell in cells)
        assert set(block["reasons"]) == {cell.reason for cell in cells} - {""}
    lssd = cells_of(blocks, titles[0], "vio_lssd (basalt)")
    assert (lssd["MH_01"], lssd["MH_02"], lssd["V2_03"]) == ("0.0800 (0.076)", "(0.045) a", "0.9000")
    assert (lssd["average"], lssd["success"], lssd["coverage"]) == ("(0.066) d", "8/8", "99.5")
    basalt = cells_of(blocks, titles[0], "basalt")
    assert (basalt["MH_02"], basalt["V2_03"], basalt["average"], basalt["success"]) == (
        "0.045",
        "– b",
        "0.066",
        "– b",
    )
    assert cells_of(blocks, titles[0], "vio_ngv")["V2_03"] == "– c"
    sgv = cells_of(blocks, titles[0], "vio_sgv")
    assert (sgv["MH_02"], sgv["success"], sgv["coverage"]) == ("– a", "– a", "– a")
    slam = cells_of(blocks, titles[0], "slam")
    assert (slam["MH_01"], slam["MH_02"], slam["V2_03"], slam["success"]) == ("– e", "– a", "– c", "0/1")
    assert cells_of(blocks, titles[0], "okvis")["MH_01"] == "0.1000 (0.085)"
    assert cells_of(blocks, "synthetic, dso_light", "dso_photo (dso)")["MH_01"] == "– c"


def test_the_average_is_of_the_papers_ten_sequences(joined, systems):
    whole = [name for name, sequence in joined.rule.sequences.items() if sequence.published]
    dso = pd.DataFrame(part_line(name, "photo", mean=1000 if name == "euroc_V2_03" else 50) for name in whole)
    none = joined_table.read_external(joined, [])
    for table, average in ((dso, "0.0500 (0.227)"), (dso[1:], "(0.227) d")):
        parts = {"dso": table, "vio": pd.DataFrame([part_line("euroc_MH_01", "lssd")])}
        lines = joined_table.make_lines(joined, systems, parts, none)
        blocks = joined_table.make_blocks(joined, systems, lines)
        assert cells_of(blocks, "euroc, undisturbed", "dso_photo (dso)")["average"] == average


@pytest.fixture
def made(tables, scores, joined, tmp_path):
    """All files, made of what the parts leave."""
    folder = tmp_path / "tables"
    folder.mkdir()
    for prefix, part in joined.parts.items():
        table = tables[prefix]
        table.to_csv(folder / f"{part.name}.csv", index=False)
        runs = table.assign(run=0, failed=table["success_scale"] == 0)
        runs.to_csv(folder / f"{part.name}_runs.csv", index=False)
        for row in runs.itertuples():
            run = tmp_path / "raw" / part.name / row.sequence / "run_0" / row.condition / row.column
            run.mkdir(parents=True)
            times = pd.DataFrame({"flow_ms": 0, "total_ms": [*range(1, 100), 1000]})
            times.to_csv(run / "timings.csv", index=False)
    joined_table.make_joined_table("table3", tmp_path / "raw", scores, ["slam/V1_01_easy"], folder, tmp_path)
    return folder


def test_documents_lead_to_the_parts_and_explain_themselves(made):
    document = (made / "table3.md").read_text()
    assert "[table3_dso](table3_dso.md), [table3_vio](table3_vio.md)." in document
    assert "whose sequence is not at hand: slam/V1_01_easy." in document
    assert "| *measured, beyond the paper* | |" in document
    link = "[{}](../../docs/deviations.md#{})".format
    notes = deviations.load_deviations()("table3_vio", "lssd")
    raised = " ".join(link(number, key) for number, key in notes)
    assert f"| vio_lssd (basalt) <sup>{raised}</sup> | 0.0800 (0.076) | (0.045) [a] |" in document
    assert (
        "[a]: the sequence is not at hand; [b]: the paper has no value; [c]: no run succeeds; [d]" in document
    )
    latex = (made / "table3.tex").read_text()
    numbers = ",".join(str(number) for number, _ in notes)
    assert f"vio\\_lssd (basalt)\\textsuperscript{{{numbers}}} & 0.0800 (0.076) & (0.045)$^a$ &" in latex
    assert "\\multicolumn{15}{l}{\\emph{published}} \\\\" in latex and "basalt & 0.076 & 0.045" in latex
    assert latex.count("\\begin{longtable}") == latex.count("\\end{longtable}") == 5


def test_timings_have_a_file_of_their_own(made):
    timings = pd.read_csv(made / "table3_timings.csv")
    assert list(timings.columns) == joined_table.TIMING
    keys = timings[["dataset", "sequence", "system"]].apply(tuple, axis=1)
    assert len(keys) == 7 and ("euroc_slice", "MH_01_easy", "vio_ngv") in set(keys), "undisturbed runs only"
    first = timings.iloc[0]
    assert (first["runs"], first["frames"], first["median_ms"]) == (1, 100, 50.5) and 99 < first[
        "p99_ms"
    ] < 200


def test_the_summary_orders_systems_by_error(made, joined):
    said = [line.strip() for line in summary.stage_lines(joined, made.parent, 0)[1:]]
    assert said[1:] == [
        "euroc_slice, sequences: 1, mean ATE mm: vio_ngv 50.0",
        "synthetic, sequences: 2, mean ATE mm:",
    ]


def test_panels_show_images_as_they_are_first(joined, systems, made):
    runs = joined_table.read_runs(joined, made)
    drawing = joined_table.draw(joined, systems, runs)
    shown = [axis.get_title() for axis in drawing.axes if axis.get_visible()]
    assert shown == [
        "euroc, undisturbed (sequences: 2)",
        "euroc_slice, undisturbed (sequences: 1)",
        "synthetic, undisturbed (sequences: 1)",
        "synthetic, dso_light (sequences: 1)",
        "synthetic, vio_light (sequences: 1)",
    ]
    ends = {line.get_label(): line.get_ydata()[-1] for line in drawing.axes[0].lines}
    assert ends == {"dso_sgf": 100, "vio_lssd": 100, "vio_ngv": 0}
    drawing.canvas.draw()
    pyplot.close(drawing)


def test_all_lines_of_a_figure_look_different(joined, systems):
    styles = joined_table.line_styles(joined, systems)
    assert len({(style["color"], style["linestyle"]) for style in styles.values()}) == len(systems)


def test_the_reference_is_made_of_its_parts(joined, tmp_path):
    tables = {prefix: pd.read_csv(REFERENCE / f"{part.name}.csv") for prefix, part in joined.parts.items()}
    systems = joined_table.list_systems(joined, [])
    lines = joined_table.make_lines(joined, systems, tables, joined_table.read_external(joined, []))
    joined_table.write_lines(lines, tmp_path, "table3")
    for name in ("table3.csv", "table3_light.csv"):
        assert (tmp_path / name).read_text() == (REFERENCE / name).read_text()
