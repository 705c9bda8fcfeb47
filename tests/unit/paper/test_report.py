"""The report of a small tree of results: nothing empty without a reason, the same bytes for the same results."""

import html
import math
import re
import shutil
from html.parser import HTMLParser

import pandas as pd
import pytest
from PIL import Image

from sgf_paper import (
    claims,
    comparison,
    config,
    deviations,
    joined_table,
    paths,
    published_values,
    report,
    report_grid,
    style,
    summary,
    text,
)
from sgf_paper.deviations import Notes
from sgf_paper.report_config import ReportTable, load_claims
from sgf_paper.style import plt

REPORT = config.load_experiment("report")
MADE = ["table1", "table2", "fig1", "fig2_minima", "fig3", "table3", "table3_dso", "odometry", "density_equal"]
NO_NOTES = Notes({}, {})
STUB = "\\begin{longtable}{l}\nstub \\\\\n\\end{longtable}\n"


@pytest.fixture
def results(tmp_path):
    """Tables of the reference run, which has no Table III of stereo-inertial odometry here, and empty figures."""
    return make_results(tmp_path / "some results")


def make_results(root):
    tables, figures = root / "tables", root / "figures"
    for folder in (tables, figures, root / "raw" / "stereo_bm" / "debian_pairs"):
        folder.mkdir(parents=True)
    for path in paths.REFERENCE.glob("*.csv"):
        if any(path.stem.startswith(name) for name in MADE) and not path.stem.startswith("table3_vio"):
            shutil.copy(path, tables)
    lines = pd.read_csv(tables / "table1_scenes.csv")
    lines[lines["dataset"] == "debian_pairs"].to_csv(tables / "table1_scenes.csv", index=False)
    for name in ("table1", "table2"):
        header = "dataset,region,matcher,cost,quantity,won,scenes\n"
        (tables / f"{name}_wins.csv").write_text(f"{header}debian_pairs,all,stereo_bm,sgf,mean_px,1,2\n")
    for name in ("table1", "table2", "table3", "table3_dso"):
        (tables / f"{name}.tex").write_text(STUB)
    for name in ("fig1", "fig1_curves", "fig2", "fig3", "fig4"):
        figure, axis = plt.subplots(figsize=(2, 2))
        axis.plot([0, 1])
        style.save(figure, figures, name)
    (tables / "fig2.csv").write_text("row,metric,shift_px,error\n")
    (root / "raw" / "stereo_bm" / "debian_pairs" / "sgf.csv").touch()
    (root / "stages.tsv").write_text("mrpt_map\tthe MRPT module is not part of the build\n")
    return root


def make(results):
    report.make_report("report", results, results / "stages.tsv", summary.main_file)
    return (results / "report.html").read_text()


@pytest.fixture
def no_latex(monkeypatch):
    monkeypatch.setattr(report.shutil, "which", lambda name: None)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A tree with its report, made once for the tests that only look at it: the folder and the page."""
    root = make_results(tmp_path_factory.mktemp("report") / "some results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report.shutil, "which", lambda name: None)
        return root, make(root)


@pytest.fixture
def page(made):
    return made[1]


class Cells(HTMLParser):
    """The text of all cells of tables, with what their title says, and all addresses."""

    def __init__(self, page):
        super().__init__()
        self.cells, self.addresses, self.anchors = [], [], set()
        self._open = False
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.addresses += [attributes[key] for key in ("src", "href") if key in attributes]
        self.anchors.add(attributes.get("id"))
        if tag == "td":
            self._open = True
            self.cells.append(["", attributes.get("title", "")])

    def handle_endtag(self, tag):
        if tag == "td":
            self._open = False

    def handle_data(self, data):
        if self._open:
            self.cells[-1][0] += data


def test_no_cell_is_empty_without_a_reason(page):
    cells = Cells(page).cells
    assert len(cells) > 5000
    assert [cell for cell in cells if not cell[0].strip()] == []
    dashes = [(shown, why) for shown, why in cells if re.match(r"^\s*(–|nan)", shown)]
    assert len(dashes) > 100 and [cell for cell in dashes if len(cell[1]) < 5] == []


def test_the_page_needs_no_other_file_and_no_network(page):
    found = Cells(page)
    assert "<link" not in page and "@import" not in page
    images = [address for address in found.addresses if address.startswith("data:image/")]
    assert len(images) == 5
    for address in set(found.addresses) - set(images):
        assert ":" not in address and not address.startswith("/"), address


def test_links_lead_to_what_made_a_number_as_long_as_it_is_there(page):
    found = Cells(page)
    assert "raw/stereo_bm/debian_pairs/sgf.csv" in found.addresses
    assert "raw/stereo_bm/debian_pairs/pm.csv" not in found.addresses
    inside = {address[1:] for address in found.addresses if address.startswith("#")}
    assert inside - found.anchors == set()
    assert {"scene-debian_pairs-Aloe", "sequence-MH_01_easy"} <= inside


def test_every_table_and_figure_of_the_paper_is_there_or_says_why_not(page):
    for item in REPORT.items:
        assert f'id="item-{item.name}"' in page
    missing = dict(re.findall(r'id="item-(\w+)">(?:(?!</article>).)*?Not shown: ([^<]*)', page, re.DOTALL))
    assert missing["mrpt_map"] == "the MRPT module is not part of the build."
    assert missing["fig5"] == "it has not been run; ./reproduce.sh --only fig5 makes it."
    assert not {"fig1", "fig4", "table1", "table3_dso"} & set(missing)
    places = " ".join(item.place for item in REPORT.items)
    assert all(f"Figure {number}" in places for number in range(1, 7))
    assert all(f"Table {number}" in places for number in ("I", "II", "III"))


def test_each_claim_has_a_verdict_and_the_number_that_says_so(made):
    results, page = made
    table = pd.read_csv(results / "tables" / "report_claims.csv")
    own = table[(table["chapter"] == "claims") & (table["id"] == "table1_bm_mean")]
    verdicts = own.drop_duplicates("source").set_index("source")["verdict"]
    assert verdicts.to_dict() == {
        "this run": "undecided", "reference run": "reproduced", "published rows": "holds",
    }  # fmt: skip
    assert "middlebury2014_q, sgf / orig: 0.52 [0.46, 0.60], 14 won, 1 lost, 0 tied of 15: better" in page
    verdicts = pd.read_csv(results / "tables" / "report_verdicts.csv")
    assert len(verdicts[verdicts["chapter"] == "claims"]) == len(load_claims().claims)
    assert verdicts.notna().all().all()


def test_only_the_papers_data_are_marked(made):
    results, page = made
    values = pd.read_csv(results / "tables" / "report_values.csv")
    assert set(values["mark"]) == {"–"}
    assert 'class="pass"' not in re.sub(r'<(?:b|td) class="pass">(?:reproduced|holds)', "", page)


RECORD = "runs/raw/stereo_bm/debian_pairs/sgf.csv/run.json"
RECORD_OF_FLIGHT = "raw/table3_dso/MH_01_easy/run_0/undisturbed/photo/run.json"
RECORD_OF_TABLE = "runs/tables/table1.csv/run.json"
EARLIER = "it failed; the run's output names the log; what is shown is of an earlier run"


@pytest.fixture(scope="module")
def earlier(tmp_path_factory):
    """A tree in which Table I is measured on the paper's data, by an earlier run, with records of runs: as `made`."""
    root = make_results(tmp_path_factory.mktemp("earlier"))
    scores = pd.read_csv(root / "tables" / "table1.csv")
    half = scores["dataset"] == "middlebury2014_h"
    scores.loc[half, "measured"] = scores.loc[half, "published"] * 1.01
    scores.loc[half, "scenes"] = 15
    scores.to_csv(root / "tables" / "table1.csv", index=False)
    for path in ("raw/stereo_bm/middlebury2014_h/sgf.csv", RECORD, RECORD_OF_FLIGHT, RECORD_OF_TABLE):
        (root / path).parent.mkdir(parents=True)
        (root / path).touch()
    (root / "stages.tsv").write_text(f"fig5\tit failed\ntable1\t{EARLIER}\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report.shutil, "which", lambda name: None)
        return root, make(root)


def test_measured_on_the_papers_data_a_value_has_its_mark_beside_it(earlier):
    shown = r'<td class="pass[^>]*><a href="raw/stereo_bm/middlebury2014_h/sgf.csv">3\.32 \(3\.29\)</a> <b>pass</b>'
    assert re.search(shown, earlier[1])


def test_only_measured_values_of_table_3_are_marked(results):
    joined = config.load_experiment("table3")
    names = [name for name, label in joined_table.labels_of(joined).items() if label != "V23"]
    key = {"dataset": "euroc", "system": "vio_lssd", "published": math.nan, "runs": 10}
    values = {"ate_mean_m": 0.066, "success_pct": 100, "coverage_pct": 100}
    own = [
        {**key, "sequence": name, "quantity": quantity, "measured": value}
        for name in names
        for quantity, value in values.items()
    ]
    lines = pd.read_csv(results / "tables" / "table3.csv")
    lines = lines[(lines["dataset"] != "euroc") | (lines["system"] != "vio_lssd")]
    pd.concat([lines, pd.DataFrame(own)]).to_csv(results / "tables" / "table3.csv", index=False)
    tables = claims.Tables(results / "tables")
    marks = report_grid.Marks(comparison.compare(tables))
    grids = report_grid.joined_grids(joined, tables.folder, report_grid.Links(results), marks, NO_NOTES)
    grid = next(grid for grid in grids if grid.title == "euroc, undisturbed")
    marked = {row[0].shown: [head for head, cell in zip(grid.head, row) if cell.mark] for row in grid.rows}
    sequences = [head for head in grid.head if head[:2] in ("MH", "V1", "V2") and head != "V2_03"]
    assert {row: heads for row, heads in marked.items() if heads} == {"vio_lssd (basalt)": [*sequences, "average"]}
    assert "basalt [published]" in marked and len(sequences) == 10


def test_what_is_there_of_an_earlier_run_is_said_to_be(earlier):
    root, page = earlier[0], html.unescape(earlier[1])
    article = page.split('id="item-table1"')[1].split("</article>")[0]
    assert f"Of an earlier run: {EARLIER}." in article and "3.32 (3.29)" in article
    assert page.count(f": {EARLIER}.") == 2, "at the head of the page as well"
    assert page.count("Of an earlier run:") == 1 and "Not shown: it failed." in page
    assert f"Of an earlier run: {EARLIER}" in (root / "report" / "item_table1.tex").read_text()
    assert EARLIER in (root / "report" / "parts.tex").read_text()


def test_a_line_links_to_the_record_of_its_run(earlier):
    found = Cells(earlier[1]).addresses
    assert found.count(RECORD) >= 4, "in both regions, of fixed parameters and of others"
    assert found.count(RECORD_OF_FLIGHT) == 1 and found.count(RECORD_OF_TABLE) == 2


def test_ratios_claims_and_counts_link_to_what_they_are_of(page):
    pairs_of = page.split('id="pairs"')[1].split('id="slips"')[0]
    assert '<td><a href="raw/stereo_bm/debian_pairs/sgf.csv">sgf</a></td>' in pairs_of
    assert re.search(r'<td><a href="tables/table1_scenes.csv">0\.\d+</a></td>', pairs_of)
    assert '<a href="tables/table1_scenes.csv">1/2</a>' in page, "scenes won"
    claim = page.split('<article id="fig3_stronger_edges">')[1].split("</article>")[0]
    lines = pd.read_csv(paths.REFERENCE / "fig3.csv")
    chosen = lines[(lines["case"] == "search") & (lines["column"] == "ngf")]
    assert f'<a href="reference/fig3.csv">fig3</a>, line {chosen.index[0] + 2}</td>' in claim


def test_measured_values_of_the_paper_link_to_their_scores(earlier):
    values = earlier[1].split('id="values"')[1].split('id="paper"')[0]
    assert '<td><a href="raw/stereo_bm/middlebury2014_h/sgf.csv">3.323</a></td>' in values


def test_the_document_has_the_reasons_of_tolerances(earlier):
    document = (earlier[0] / "report" / "values.tex").read_text()
    for entry in published_values.load_comparisons().values():
        for tolerance in entry.tolerances:
            assert text._latex_prose(tolerance.reason) in document


def test_failed_runs_are_shown(page):
    runs = pd.read_csv(paths.REFERENCE / "table3_dso_runs.csv")
    assert runs["failed"].any()
    shown = page[page.index('id="sequence-MH_01_easy"') :]
    assert "∞" in shown
    assert "failed 5 and 5" in page, "of pairs of runs those that fail are counted"


def test_without_latex_only_the_pdf_is_left_out_and_that_is_said(results, no_latex):
    (results / "report.pdf").write_text("of an earlier run")
    page = make(results)
    assert "report.pdf was not made: latexmk is not installed (packages.apt, section [report])" in page
    assert not (results / "report.pdf").exists()


def test_an_empty_tree_gives_a_report_that_says_so(tmp_path, no_latex):
    page = make(tmp_path)
    assert page.count("Not shown: it has not been run") == len(REPORT.items)
    assert "No table with methods to compare was made." in page
    assert "No scores of scenes or runs were made." in page


def test_main_tex_has_each_item_of_the_paper_once():
    document = report.MAIN.read_text()
    for item in REPORT.items:
        assert document.count(f"\\input{{item_{item.name}}}") == (1 if item.place else 0)


@pytest.mark.skipif(not shutil.which("latexmk"), reason="latexmk is not installed")
def test_page_and_document_repeat_to_the_byte(tmp_path):
    one, two = make_results(tmp_path / "one"), make_results(tmp_path / "a longer name")
    for results in (one, two):
        make(results)
    for name in ("report.html", "report.pdf"):
        assert (one / name).read_bytes() == (two / name).read_bytes()
    document = (one / "report.pdf").read_bytes()
    assert document.startswith(b"%PDF") and b"CreationDate" not in document and str(tmp_path).encode() not in document
    assert "Overfull" not in (one / "report" / "main.log").read_text()


@pytest.mark.skipif(not shutil.which("latexmk"), reason="latexmk is not installed")
def test_what_latex_does_not_take_is_an_error_that_names_the_log(results):
    (results / "tables" / "table1.tex").write_text("\\nonsense\n")
    with pytest.raises(report.ReportError, match=r"Undefined control sequence(?s:.*)main.log"):
        make(results)
    assert (results / "report.html").exists()


def test_large_figures_are_compressed(tmp_path):
    noise = Image.effect_noise((600, 600), 90)
    noise.save(tmp_path / "large.png")
    uri = report.data_uri(tmp_path / "large.png")
    assert uri.startswith("data:image/webp;base64,") and len(uri) < (tmp_path / "large.png").stat().st_size


def write_csv(folder, content):
    (folder / "t.csv").write_text(content)
    return folder


def test_lines_of_a_table_have_reasons_links_and_few_digits(tmp_path):
    folder = write_csv(tmp_path, "name,run,ms,ratio\na,1,12.3456,\nb,2,inf,1.0000\n")
    (tmp_path / "raw" / "1").mkdir(parents=True)
    spec = ReportTable("t", "T", ["name", "ms", "ratio"], empty={"ratio": "lost"}, run="raw/{run}")
    grid = report_grid.csv_grid("toy", spec, folder, report_grid.Links(tmp_path), NO_NOTES)
    assert [[cell.shown for cell in row] for row in grid.rows] == [["a", "12.35", "–"], ["b", "∞", "1"]]
    assert [cell.reason for cell in grid.rows[0]] == ["", "", "lost"] and grid.reasons == {"lost": "a"}
    assert grid.rows[0][1].href == "raw/1" and grid.rows[1][1].href == ""


def test_columns_that_a_table_lacks_are_named(tmp_path):
    spec = ReportTable("t", "T", ["colour"])
    with pytest.raises(claims.ClaimError, match="table t has no column colour"):
        report_grid.csv_grid("toy", spec, write_csv(tmp_path, "a\n1\n"), report_grid.Links(tmp_path), NO_NOTES)


def test_reasons_beyond_z_have_two_letters():
    rows = [[report_grid.empty(f"reason {index}")] for index in range(28)]
    assert list(report_grid.Grid("T", ["a"], rows).reasons.values())[-3:] == ["z", "aa", "ab"]


@pytest.mark.parametrize(
    "prose, latex, html",
    [
        ("e_sgf3 of 5 %", r"$e_\mathrm{sgf3}$ of 5 \%", "<i>e</i><sub>sgf3</sub> of 5 %"),
        ("`a_b` < ∞", r"\texttt{a\_b} $<$ $\infty$", "<code>a_b</code> &lt; ∞"),
        (r"the_sum \x", r"the\_sum \textbackslash{}x", r"the_sum \x"),
    ],
)
def test_prose_is_escaped_and_dissimilarities_are_symbols(prose, latex, html):
    assert (text._latex_prose(prose), str(text._html_prose(prose))) == (latex, html)


def test_rows_link_to_their_deviations_which_the_page_holds(page):
    notes = deviations.load_deviations()
    anchors = re.findall(r'<tr id="deviation-([a-z0-9-]+)"><td>(\d+)</td>', page)
    assert {key: int(number) for key, number in anchors} == notes.numbers
    links = re.findall(r'<a href="#deviation-([a-z0-9-]+)" title="\1">(\d+)</a>', page)
    assert {(key, int(number)) for key, number in links} <= set(notes.numbers.items())
    orig = re.search(r'<td>(?:<a href="[^"]*">)?orig(?:</a>)? <sup>(.*?)</sup></td>', page)[1]
    assert re.findall(r"#deviation-([a-z0-9-]+)", orig) == [key for _, key in notes("stereo_bm", "orig")]
    whole = page.split('id="item-fig2"')[1].split("as a whole: ")[1].split("</p>")[0]
    assert re.findall(r"#deviation-([a-z0-9-]+)", whole) == [key for _, key in notes("fig2")]


def test_the_document_has_the_deviations_too(results):
    make(results)
    folder = results / "report"
    assert "ngf\\textsuperscript{12}" in (folder / "item_fig3.tex").read_text()
    numbers = [number for number, _ in deviations.load_deviations()("fig2")]
    shown = f"(Section~\\ref{{deviations}}): {', '.join(map(str, numbers))}."
    assert shown in (folder / "item_fig2.tex").read_text()
    lines = (folder / "deviations.tex").read_text()
    assert lines.count("\\\\\n") == len(deviations.load_deviations().numbers) + len(deviations.read_chapters())
