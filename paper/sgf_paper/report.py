"""The report: results/report.html, one file that needs no network, and results/report.pdf by LaTeX.

It is made of what is there. What is not there is named with its reason, and no cell is empty without one. It says of
each claim of the paper what the runs show of it, and marks values as near to the paper's only where they can be
compared. The same results give the same bytes.
"""

from __future__ import annotations

import argparse
import base64
import io
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from PIL import Image

from sgf_paper import claims, comparison, config, pairs, paths, report_grid, summary, text
from sgf_paper.claims import Finding, Tables
from sgf_paper.deviations import Chapter, Notes, load_deviations, read_chapters
from sgf_paper.report_config import Report, ReportItem, load_claims
from sgf_paper.report_grid import Grid, Links, Marks, Page
from sgf_paper.strict_yaml import ConfigError

MAIN = paths.PAPER / "main.tex"
CHAPTERS = ["claims", "slips", "new"]
PNG_BYTES = 150_000  # larger figures become WebP
MOST_RUNS = 4  # that an outcome names; its lines name more
NOT_RUN = "it has not been run; ./reproduce.sh --only {} makes it"
# What the verdicts of a chapter are called.
WORDS = {
    "claims": {claims.REPRODUCED: "reproduced", claims.PARTLY: "partly reproduced", claims.NOT: "not reproduced"},
    "slips": {
        claims.REPRODUCED: "the exact form does better",
        claims.PARTLY: "the exact form does better in part",
        claims.NOT: "the exact form does no better",
    },
    "new": {claims.REPRODUCED: "holds", claims.PARTLY: "holds in part", claims.NOT: "does not hold"},
}
WORDS["published"] = WORDS["new"]
CLASSES = {claims.REPRODUCED: "pass", claims.PARTLY: "near", claims.NOT: "fail"}


class ReportError(Exception):
    """Why the report cannot be made."""


@dataclass(frozen=True)
class Part:
    """An experiment and why there is nothing of it; the reason is empty where there is."""

    name: str
    title: str
    reason: str
    earlier: str = ""  # why what there is is of an earlier run; empty where it is not
    record: str = ""  # run.json of what made it, below the results


@dataclass(frozen=True)
class ShownItem:
    """A table or figure with all that there is of it."""

    item: ReportItem
    part: Part
    grids: list[Grid]
    printed: list[Grid]  # those that LaTeX gets
    figures: list[str]
    latex: list[str]
    notes: list[tuple[int, str]]  # deviations from the paper of all of it


@dataclass(frozen=True)
class Contents:
    """All that both forms of the report show."""

    report: Report
    findings: dict[str, list[Finding]]  # by chapter
    values: pd.DataFrame
    pairs: dict[str, pd.DataFrame]  # by title
    runs_of: report_grid.RunLinks
    items: list[ShownItem]
    parts: list[Part]
    pages: list[Page]
    averages: pd.DataFrame
    deviations: list[Chapter]
    numbers: dict[str, int]  # of deviations, by key

    @property
    def tolerances(self) -> dict[str, str]:
        """Letters of the reasons of tolerances."""
        return {reason: report_grid.letters(index) for index, reason in enumerate(self.values["tolerance"].unique())}

    @property
    def counts(self) -> dict[str, int]:
        """How many of the paper's claims have which verdict."""
        verdicts = [finding.judged.verdict for finding in self.findings["claims"]]
        order = [claims.REPRODUCED, claims.PARTLY, claims.NOT, claims.UNDECIDED, claims.NOT_MEASURED]
        return {word("claims", verdict): verdicts.count(verdict) for verdict in order if verdict in verdicts}

    @property
    def marks(self) -> dict[str, int]:
        """How many of the paper's values have which mark."""
        return {mark: int((self.values["mark"] == mark).sum()) for mark in ("pass", "near", "fail", "–")}


def word(chapter: str, verdict: str) -> str:
    """What a verdict is called in a chapter."""
    return WORDS[chapter].get(verdict, verdict)


def title(chapter: str, finding: Finding) -> str:
    """The verdict on a statement."""
    if not finding.claim.checks:
        return "by argument" if finding.published is None else word("published", finding.judged.verdict)
    return word(chapter, finding.judged.verdict)


def list_parts(results: Path, reasons: dict[str, str], main_file: Callable) -> list[Part]:
    """All experiments but the report itself. @param main_file says where an experiment's main file is."""
    parts, links = [], Links(results)
    for path in sorted(paths.EXPERIMENTS.glob("*.yaml")):
        experiment = config.load_experiment(path.stem)
        if experiment.kind == "report":
            continue
        reason = reasons.get(path.stem, "")
        if main_file(experiment, results).exists():
            made = main_file(experiment, Path())
            record = links.record(f"tables/{made.stem}.csv") or links.record(str(made))
            parts.append(Part(path.stem, experiment.title, "", reason, record))
        else:
            parts.append(Part(path.stem, experiment.title, reason or NOT_RUN.format(path.stem)))
    return parts


def groups_of(experiment: Any) -> list[str]:
    """What deviations of a whole table or figure are listed under."""
    sweeps = [sweep.name for sweep in experiment.sweeps] if experiment.kind == "table" else []
    parts = [part.name for part in experiment.parts.values()] if experiment.kind == "joined_table" else []
    return [experiment.name, *sweeps, *parts]


def show_item(
    item: ReportItem, part: Part, results: Path, links: Links, marks: Marks, notes: Notes
) -> ShownItem:
    """What there is of a table or figure."""
    if part.reason:
        return ShownItem(item, part, [], [], [], [], [])
    tables = results / "tables"
    experiment = config.load_experiment(item.name)
    grids: list[Grid] = []
    if experiment.kind == "table":
        grids = report_grid.stereo_grids(experiment, tables, links, marks, notes)
    elif experiment.kind == "joined_table":
        grids = report_grid.joined_grids(experiment, tables, links, marks, notes)
    own = [(spec, report_grid.csv_grid(item.name, spec, tables, links, notes)) for spec in item.tables]
    grids += [grid for _, grid in own if grid]
    return ShownItem(
        item, part, grids,
        printed=[grid for spec, grid in own if grid and not spec.only_html],
        figures=[name for name in item.figures if (results / "figures" / f"{name}.png").exists()],
        latex=[name for name in item.latex if (tables / f"{name}.tex").exists()],
        notes=sorted({note for group in groups_of(experiment) for note in notes(group)}),
    )  # fmt: skip


def compare_methods(report: Report, tables: Tables, links: Links) -> dict[str, pd.DataFrame]:
    """All pairs of methods, by the title of what they are of."""
    rule = pairs.Rule(report.verdict_clusters, report.margin_pct)
    found = {}
    for spec in report.pairs:
        lines = tables(spec.table)
        if lines is not None and not lines.empty:
            found[spec.title] = report_grid.link_pairs(spec, pairs.make_table(spec, lines, rule), links)
    return found


def find(report: Report, sources: dict[str, Tables]) -> dict[str, list[Finding]]:
    """All claims with what the sources and the paper's rows say."""
    rule = pairs.Rule(report.verdict_clusters, report.margin_pct)
    every, published = load_claims(), comparison.PublishedRows()
    return {
        chapter: [claims.judge(claim, sources, published, rule) for claim in getattr(every, chapter)]
        for chapter in CHAPTERS
    }


def list_pages(results: Path, parts: list[Part]) -> list[Page]:
    """All scenes, then all sequences."""
    stereo = list(config.load_experiments("table").values())
    studies = report_grid.load_studies([part.name for part in parts])
    tables, links = results / "tables", Links(results)
    return [*report_grid.scene_pages(stereo, tables, links), *report_grid.sequence_pages(studies, tables, links)]


def gather(name: str, results: Path, reasons: dict[str, str], main_file: Callable) -> Contents:
    """Everything that the report shows."""
    report = config.load_experiment(name)
    tables = Tables(results / "tables")
    parts = list_parts(results, reasons, main_file)
    by_name = {part.name: part for part in parts}
    values = comparison.compare(tables)
    marks = Marks(values)
    pages = list_pages(results, parts)
    links = Links(results, pages)
    notes = load_deviations()
    return Contents(
        report=report,
        findings=find(report, {claims.THIS_RUN: tables, claims.REFERENCE: Tables(paths.REFERENCE)}),
        values=report_grid.link_values(values, links),
        pairs=compare_methods(report, tables, links),
        runs_of=report_grid.RunLinks(report, tables, links),
        items=[show_item(item, by_name[item.name], results, links, marks, notes) for item in report.items],
        parts=parts,
        pages=pages,
        averages=comparison.averages(),
        deviations=read_chapters(),
        numbers=notes.numbers,
    )


def data_uri(path: Path) -> str:
    """A figure as part of the page; large ones compressed so that all fit into one file."""
    data, kind = path.read_bytes(), "png"
    if len(data) > PNG_BYTES:
        stream = io.BytesIO()
        Image.open(path).convert("RGB").save(stream, "WEBP", quality=85, method=4)
        data, kind = min((data, "png"), (stream.getvalue(), "webp"), key=lambda form: len(form[0]))
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def write_whole(path: Path, content: str) -> None:
    """Writes a file under a temporary name first."""
    part = path.with_name(path.name + ".part")
    part.write_text(content)
    part.replace(path)


def write_html(contents: Contents, results: Path, no_pdf: str) -> None:
    """Writes report.html. @param no_pdf why there is no PDF; empty if there is."""
    figures = {
        name: data_uri(results / "figures" / f"{name}.png") for shown in contents.items for name in shown.figures
    }
    document = text.render(
        "report.html.j2", c=contents, figures=figures, no_pdf=no_pdf, word=word, title=title,
        classes=CLASSES, most_runs=MOST_RUNS,
    )  # fmt: skip
    write_whole(results / "report.html", document)


def write_fragments(contents: Contents, folder: Path) -> None:
    """Writes what main.tex reads, and main.tex beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    context = {"c": contents, "word": word, "title": title}
    for name in ("values", "pairs", "deviations", "parts"):
        write_whole(folder / f"{name}.tex", text.render(f"report_{name}.tex.j2", **context))
    for chapter, findings in contents.findings.items():
        fragment = text.render("report_claims.tex.j2", chapter=chapter, findings=findings, **context)
        write_whole(folder / f"{chapter}.tex", fragment)
    beyond = []
    for shown in contents.items:
        fragment = text.render("report_item.tex.j2", shown=shown)
        write_whole(folder / f"item_{shown.item.name}.tex", fragment)
        beyond += [] if shown.item.place else [f"\\input{{item_{shown.item.name}}}\n"]
    write_whole(folder / "beyond.tex", "".join(beyond))
    shutil.copyfile(MAIN, folder / "main.tex")


def why_no_pdf() -> str:
    """What is missing to make a PDF; empty if nothing is."""
    return "" if shutil.which("latexmk") else "latexmk is not installed (packages.apt, section [report])"


def build_pdf(results: Path, folder: Path) -> None:
    """Has latexmk make report.pdf; it carries no time and no path."""
    command = ["latexmk", "-norc", "-pdf", "-g", "-interaction=nonstopmode", "-halt-on-error", "main.tex"]
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "0", "FORCE_SOURCE_DATE": "1", "max_print_line": "200"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, errors="replace")
    if done.returncode:
        wrong = re.findall(r"^!.*(?:\n.*){0,3}", done.stdout, re.MULTILINE)
        raise ReportError(f"latexmk failed: {wrong[0] if wrong else done.stderr.strip()} (log: {folder / 'main.log'})")
    shutil.copyfile(folder / "main.pdf", results / "report.pdf.part")
    (results / "report.pdf.part").replace(results / "report.pdf")


def claim_table(contents: Contents) -> pd.DataFrame:
    """A line for each outcome of each claim."""
    lines = []
    for chapter, findings in contents.findings.items():
        for finding in findings:
            own = {"chapter": chapter, "id": finding.claim.id, "place": finding.claim.place}
            sources = {**finding.sources, **({"published rows": finding.published} if finding.published else {})}
            for source, judged in sources.items():
                called = word("published" if judged is finding.published else chapter, judged.verdict)
                head = {**own, "source": source, "verdict": called, "reason": judged.reason}
                lines += [
                    {**head, "table": o.table, "where": o.where, "outcome": o.state, "number": o.number}
                    for o in judged.outcomes
                ] or [{**head, "table": "", "where": "", "outcome": judged.verdict, "number": ""}]
    return pd.DataFrame(lines)


def verdict_table(contents: Contents) -> pd.DataFrame:
    """A line for each statement."""
    return pd.DataFrame([
        {"chapter": chapter, "id": finding.claim.id, "verdict": title(chapter, finding), "by": finding.by}
        for chapter, findings in contents.findings.items()
        for finding in findings
    ])  # fmt: skip


def write_csvs(contents: Contents, tables: Path, name: str) -> None:
    """Writes the verdicts, the values and the pairs as tables."""
    tables.mkdir(parents=True, exist_ok=True)
    verdict_table(contents).to_csv(tables / f"{name}_verdicts.csv", index=False)
    claim_table(contents).to_csv(tables / f"{name}_claims.csv", index=False)
    contents.values[comparison.ROW].round(6).to_csv(tables / f"{name}_values.csv", index=False)
    every = list(contents.pairs.values()) or [pd.DataFrame(columns=pairs.ROW)]
    pd.concat(every, ignore_index=True)[pairs.ROW].round(4).to_csv(tables / f"{name}_pairs.csv", index=False)


def make_report(name: str, results: Path, listing: Path, main_file: Callable) -> None:
    """Makes report.html, report.pdf where LaTeX is there, and their numbers as tables."""
    contents = gather(name, results, summary.read_reasons(listing), main_file)
    write_csvs(contents, results / "tables", name)
    write_fragments(contents, results / "report")
    no_pdf = why_no_pdf()
    write_html(contents, results, no_pdf)
    if no_pdf:
        print(f"No PDF: {no_pdf}")
        (results / "report.pdf").unlink(missing_ok=True)
    else:
        build_pdf(results, results / "report")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="report of paper/experiments")
    parser.add_argument("--results", type=Path, required=True, help="folder of all results")
    parser.add_argument("--reasons", type=Path, required=True, help="listing of what was not made, and why")
    arguments = parser.parse_args()
    try:
        make_report(arguments.name, arguments.results, arguments.reasons, summary.main_file)
    except (ReportError, claims.ClaimError, ConfigError) as error:
        sys.exit(f"Error: {error}")


if __name__ == "__main__":
    main()
