"""Tables of the report: cells with the reason why they are empty, a link to what made them, and how near the paper's
value is where that can be said."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import pandas as pd

from sgf_paper import claims, comparison, config, joined_table, text
from sgf_paper.deviations import Notes
from sgf_paper.joined_table import System
from sgf_paper.report_config import Report, ReportPairs, ReportTable
from sgf_paper.stereo_config import Table
from sgf_paper.study_config import SelfMatch
from sgf_paper.tracking_config import JoinedTable, TrajectoryTable

NO_VALUE = "the table has no value here"
RECORD = "run.json"
PAGES = {"scene": "scene-{}-{}", "sequence": "sequence-{}"}


@dataclass(frozen=True)
class Cell:
    """A value as text; without one there is a reason."""

    shown: str
    reason: str = ""
    href: str = ""  # relative to the results, or an anchor
    mark: str = ""  # pass, near or fail
    best: bool = False
    notes: list[tuple[int, str]] = field(default_factory=list)  # deviations from the paper
    record: str = ""  # of the run that made the line, in its first cell


@dataclass(frozen=True)
class Grid:
    title: str
    head: list[str]
    rows: list[list[Cell]]
    note: str = ""

    @property
    def reasons(self) -> dict[str, str]:
        """Letters of the reasons in the table."""
        found = dict.fromkeys(cell.reason for row in self.rows for cell in row if cell.reason)
        return {reason: letters(index) for index, reason in enumerate(found)}


@dataclass(frozen=True)
class Page:
    """All lines of one scene or sequence."""

    anchor: str
    title: str
    grids: list[Grid] = field(default_factory=list)
    aliases: list[str] = field(default_factory=list)  # further anchors: what experiments call the sequence


def letters(index: int) -> str:
    """a to z, then aa, ab, ..."""
    return (letters(index // 26 - 1) if index >= 26 else "") + chr(ord("a") + index % 26)


def as_number(shown: str) -> float | None:
    """What a text of a CSV file says, if that is a number."""
    try:
        return float(shown)
    except ValueError:
        return None


def empty(reason: str) -> Cell:
    return Cell("–", reason or NO_VALUE)


class Links:
    """What made a value, below the results or further down on the page; empty where it is not there."""

    def __init__(self, results: Path, pages: Iterable[Page] = ()):
        self.results = results
        self.anchors = {f"#{anchor}" for page in pages for anchor in (page.anchor, *page.aliases)}

    def __call__(self, path: str) -> str:
        return path if path in self.anchors or path and (self.results / path).exists() else ""

    def record(self, path: str) -> str:
        """The run.json of the run that made a file or folder."""
        for made in (Path(path), *Path(path).parents):
            for folder in (made, "runs" / made):
                if (self.results / folder / RECORD).exists():
                    return (folder / RECORD).as_posix()
        return ""

    def name_run(self, cells: list[Cell], path: str) -> list[Cell]:
        """A line whose first cell links to the record of the run that made it."""
        return [replace(cells[0], record=self.record(path)), *cells[1:]]


def csv_grid(name: str, spec: ReportTable, folder: Path, links: Links, notes: Notes) -> Grid | None:
    """Lines of a CSV file of experiment `name`; None where it is not there."""
    path = folder / f"{spec.table}.csv"
    if not path.exists():
        return None
    lines = pd.read_csv(path, dtype=str, keep_default_na=False)
    typed = pd.read_csv(path)
    claims.require_columns(lines, [*spec.columns, *spec.empty], spec.table)
    lines = lines.loc[claims.choose(typed, spec.where, spec.table).index]
    columns = spec.columns or list(lines.columns)
    rows = []
    for line in lines.to_dict("records"):
        href = links(spec.run.format(**line))
        cells = [_csv_cell(line[column], spec.empty.get(column, ""), href) for column in columns]
        if "column" in columns:
            at = columns.index("column")
            cells[at] = replace(cells[at], notes=notes(name, line["column"]))
        rows.append(links.name_run(cells, spec.run.format(**line)))
    return Grid(spec.title, columns, rows)


def _csv_cell(shown: str, reason: str, href: str) -> Cell:
    """A value of a CSV file; a number has four significant digits and a link to what made it."""
    if shown == "":
        return empty(reason)
    value = as_number(shown)
    if value is None:
        return Cell(shown)
    whole = "." not in shown and shown != "inf"
    return Cell(shown if whole else claims.shown(value), href=href)


class Marks:
    """How near measured values are to the paper's, by what they are of."""

    def __init__(self, values: pd.DataFrame):
        self.values = {tuple(line[key] for key in comparison.KEYS): line for line in values.to_dict("records")}

    def __call__(self, *key: str, by: str = "") -> str:
        """The mark of a value; none if another system than `by` was measured."""
        value = self.values.get(key)
        if value is None or value["mark"] == comparison.NO_MARK or value["measured_by"] != by:
            return ""
        return value["mark"]


def stereo_grids(table: Table, folder: Path, links: Links, marks: Marks, notes: Notes) -> list[Grid]:
    """Tables I and II: blocks of fixed parameters, then of cross-validated ones."""
    main = table.blocks[0].sweep.main_columns
    wins = pd.read_csv(folder / f"{table.name}_wins.csv")
    grids = []
    for end, kind in (("", "fixed parameters"), ("_tuned", "cross-validated")):
        frame = pd.read_csv(folder / f"{table.name}{end}.csv")
        won = wins if end == "" else wins.iloc[:0]
        for block in text.make_blocks(frame, won, table.quantities, main):
            grids.append(_stereo_grid(table, block, kind, links, marks if end == "" else None, notes))
    return grids


def _stereo_grid(
    table: Table, block: text.Block, kind: str, links: Links, marks: Marks | None, notes: Notes
) -> Grid:
    matcher = text.matcher_name(block.matcher)
    scenes = f"{block.scenes} scenes" if block.scenes else "published values only"
    missing = "no pixel is matched" if block.scenes else f"{block.dataset} is not at hand"
    rows = []
    for row in block.rows:
        scores = f"raw/{matcher}/{block.dataset}/{row.cost}"
        href = links(f"{scores}.csv")
        shown, options = row.cost + (" (extra)" if row.extra else ""), links(f"{scores}.options.yaml")
        cells = [Cell(shown, href=options, notes=notes(matcher, row.cost))]
        for quantity, cell in zip(table.quantities, row.cells):
            mark = marks(table.name, f"{matcher}, {block.region}", row.cost, quantity, quantity) if marks else ""
            cells.append(_stereo_cell(cell, missing, href, mark))
        won = _won_cell(row, block, kind, links(f"tables/{table.name}_scenes.csv"))
        rows.append(links.name_run([*cells, won], f"{scores}.csv"))
    title = f"{block.dataset}, {block.region}, {block.matcher}, {kind} ({scenes})"
    head = ["cost", *(text.LABELS[quantity] for quantity in table.quantities), "scenes won"]
    note = (
        "In brackets: published, or of how many scenes a mean is where no pixel is matched on others."
        " A cost links to its options, a value to the scores of its scenes."
    )
    return Grid(title, head, rows, note)


def _stereo_cell(cell: text.Cell, missing: str, href: str, mark: str) -> Cell:
    published = f" ({cell.published})" if cell.published else ""
    if cell.measured:
        return Cell(cell.shown + published, href=href, mark=mark, best=cell.best)
    reason = missing if published else f"{missing}, and the paper has no value"
    return Cell(f"–{published}", reason if missing != "no pixel is matched" else missing)


def _won_cell(row: text.Row, block: text.Block, kind: str, href: str) -> Cell:
    if row.won:
        return Cell(row.won, href=href)
    if row.extra:
        return empty("only the paper's columns count")
    return empty("counted for fixed parameters only" if block.scenes else f"{block.dataset} is not at hand")


def joined_grids(joined: JoinedTable, folder: Path, links: Links, marks: Marks, notes: Notes) -> list[Grid]:
    """Table III, a block for each data set and condition."""
    light = pd.read_csv(folder / f"{joined.name}_light.csv")
    undisturbed = pd.read_csv(folder / f"{joined.name}.csv").assign(condition=joined_table.UNDISTURBED)
    lines = pd.concat([undisturbed, light], ignore_index=True)
    own = {system.name for system in joined_table.list_systems(joined, [])}
    run = set(lines.loc[lines["runs"] > 0, "system"])
    others = sorted(set(lines["system"]) - own | run & set(joined.published))
    systems = joined_table.list_systems(joined, others)
    blocks = joined_table.make_blocks(joined, systems, lines)
    return [_joined_grid(joined, block, links, marks, notes) for block in blocks]


def _joined_grid(joined: JoinedTable, block: dict, links: Links, marks: Marks, notes: Notes) -> Grid:
    labels = {"_".join(name.split("_")[:2]): (name, label) for name, label in joined_table.labels_of(joined).items()}
    euroc = block["title"].startswith("euroc,")
    labels["average"] = "", "avg"
    heads = [*block["sequences"], "average", "success", "coverage %"]
    rows = []
    for row in block["rows"]:
        system = row["system"]
        group = f" [{system.group}]" if system.group != joined_table.REBUILT else ""
        cells = [Cell(row["label"] + group, notes=notes(*system.column))]
        for head, cell in zip(heads, row["cells"]):
            name, label = labels.get(head, ("", ""))
            mark = marks(joined.name, "", system.published, label, "ate_mean_m", by=system.name) if euroc else ""
            href = "" if cell.reason else links(_joined_run(joined, system, name))
            cells.append(Cell(cell.shown, block["reasons"].get(cell.reason, ""), href, mark))
        rows.append(cells)
    note = (
        "ATE in m, mean over frames and over the runs that succeed; how many do stands under success, and what fails is"
        " infinite wherever methods are compared. In brackets: published."
    )
    return Grid(block["title"], ["system", *heads], rows, note)


def _joined_run(joined: JoinedTable, system: System, sequence: str) -> str:
    """What made a system's value of a sequence, by EuRoC's name, or of all of them; nothing of what is published."""
    if system.group == joined_table.PUBLISHED:
        return ""
    if system.group == joined_table.EXTERNAL:
        folder = f"raw/{joined.name}/external/{system.name}"
        return f"{folder}/{sequence}.csv" if sequence else folder
    return f"#{PAGES['sequence'].format(sequence)}" if sequence else f"tables/{system.column[0]}_runs.csv"


def link_values(values: pd.DataFrame, links: Links) -> pd.DataFrame:
    """The paper's values with `href`, what made the measured one, and `record`, of the run."""
    runs = {name: _value_runs(config.load_experiment(name)) for name in values["table"].unique()}
    paths = [
        runs[line["table"]](line) if line["measured"] == line["measured"] else "" for line in values.to_dict("records")
    ]
    return values.assign(href=[links(path) for path in paths], record=[links.record(path) for path in paths])


def _value_runs(experiment: Table | JoinedTable | SelfMatch) -> Callable[[dict], str]:
    """Says of a line of the paper's values what made the measured one."""
    if experiment.kind == "table":
        data = experiment.published_dataset
        return lambda line: f"raw/{line['part'].split(',')[0]}/{data}/{line['row']}.csv"
    if experiment.kind == "self_match":
        return lambda line: f"raw/{experiment.name}/{experiment.published_group}_{line['column']}.csv"
    systems = {system.name: system for system in joined_table.list_systems(experiment, experiment.published)}
    names = {label: name for name, label in joined_table.labels_of(experiment).items()}
    return lambda line: _joined_run(experiment, systems[line["measured_by"]], names.get(line["column"], ""))


def link_pairs(spec: ReportPairs, table: pd.DataFrame, links: Links) -> pd.DataFrame:
    """Comparisons with what made the errors of both methods, and where their pairs stand."""
    groups = [dict(zip(spec.groups, where.split(", "))) for where in table["where"]]
    for side in ("own", "other"):
        paths = [spec.run.format(**group, **{spec.method: name}) for group, name in zip(groups, table[side])]
        table[f"{side}_href"] = [links(path) for path in paths]
    return table.assign(href=links(f"tables/{spec.table}.csv"))


class RunLinks:
    """What made the lines that an outcome rests on, as the report has it of their tables."""

    def __init__(self, report: Report, tables: claims.Tables, links: Links):
        shown = [spec for item in report.items for spec in item.tables]
        self.patterns = {spec.table: spec.run for spec in [*shown, *report.pairs] if spec.run}
        self.tables, self.links = tables, links

    def __call__(self, outcome: claims.Outcome) -> list[str]:
        if not outcome.lines:
            return []
        pattern = self.patterns.get(outcome.table, "")
        lines = self.tables(outcome.table).loc[[line - claims.FIRST_LINE for line in outcome.lines]]
        found = dict.fromkeys(self.links(pattern.format(**line)) for line in lines.to_dict("records"))
        return [href for href in found if href]


def _page(pages: dict[str, Page], kind: str, title: str, *key: str) -> Page:
    """The page of that title, begun if there is none."""
    return pages.setdefault(title, Page(PAGES[kind].format(*key), title))


def scene_pages(tables: list[Table], folder: Path, links: Links) -> list[Page]:
    """All scores at fixed parameters by scene."""
    pages: dict[str, Page] = {}
    for table in tables:
        path = folder / f"{table.name}_scenes.csv"
        if not path.exists():
            continue
        lines = pd.read_csv(path, dtype=str, keep_default_na=False)
        for (dataset, scene), own in lines.groupby(["dataset", "scene"], sort=False):
            page = _page(pages, "scene", f"{dataset}: {scene}", dataset, scene)
            page.grids.append(_scene_grid(table, own.drop(columns=["dataset", "scene"]), dataset, links))
    return list(pages.values())


def _scene_grid(table: Table, lines: pd.DataFrame, dataset: str, links: Links) -> Grid:
    rows = []
    for line in lines.to_dict("records"):
        href = links(f"raw/{line['matcher']}/{dataset}/{line['cost']}.csv")
        cells = [_csv_cell(shown, "no pixel is matched", href) for shown in line.values()]
        rows.append(links.name_run(cells, href))
    return Grid(f"{table.title}: fixed parameters", list(lines.columns), rows)


def sequence_pages(studies: dict[str, Callable[[str], str]], folder: Path, links: Links) -> list[Page]:
    """All runs by sequence. @param studies what a sequence is called, by experiment."""
    pages: dict[str, Page] = {}
    for name, called in studies.items():
        path = folder / f"{name}_runs.csv"
        if not path.exists():
            continue
        lines = pd.read_csv(path, dtype=str, keep_default_na=False)
        for sequence, own in lines.groupby("sequence", sort=False):
            page = _page(pages, "sequence", called(sequence), called(sequence))
            alias = PAGES["sequence"].format(sequence)
            if alias not in (page.anchor, *page.aliases):
                page.aliases.append(alias)
            page.grids.append(_runs_grid(name, sequence, own.drop(columns="sequence"), links))
    return list(pages.values())


def _runs_grid(name: str, sequence: str, lines: pd.DataFrame, links: Links) -> Grid:
    rows = []
    for line in lines.to_dict("records"):
        href = links(f"raw/{name}/{sequence}/run_{line['run']}/{line['condition']}/{line['column']}")
        rows.append(links.name_run([_run_cell(column, shown, href) for column, shown in line.items()], href))
    note = "∞: the run fails. A value links to its run."
    return Grid(f"{name}: runs on {sequence}", list(lines.columns), rows, note)


def _run_cell(column: str, shown: str, href: str) -> Cell:
    if shown == "":
        return empty("too few poses" if column != "compared" else "a lost run is not compared")
    return _csv_cell(shown, "", href)


def euroc_name(study: TrajectoryTable) -> Callable[[str], str]:
    """What EuRoC calls a sequence of a table, so that all lines of it stand together."""
    return lambda name: study.sequences[name].euroc_name


def load_studies(names: list[str]) -> dict[str, Callable[[str], str]]:
    """What experiments with repeated runs call their sequences."""
    found = {}
    for name in names:
        study = config.load_experiment(name)
        if study.kind in ("odometry", "trajectory_table"):
            found[name] = euroc_name(study) if study.kind == "trajectory_table" else str
    return found
