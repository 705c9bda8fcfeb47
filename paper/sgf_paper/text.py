"""The tables as text: CSV files, and blocks of formatted cells that the templates lay out."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import jinja2
import markupsafe
import pandas as pd

from sgf_paper import paths

LABELS = {
    "mean_px": "mean px",
    "median_px": "median px",
    "bad1_pct": "bad 1 %",
    "bad2_pct": "bad 2 %",
    "bad4_pct": "bad 4 %",
    "d1_pct": "D1 %",
    "invalid_pct": "invalid %",
}
MATCHERS = {"stereo_bm": "StereoBM", "stereo_mesh": "MeshStereo", "stereo_sgm": "SGM"}


def matcher_title(matcher: str) -> str:
    """What a matcher is called in tables and figures."""
    return MATCHERS.get(matcher, matcher)


def matcher_name(title: str) -> str:
    """The matcher of that title."""
    return {shown: name for name, shown in MATCHERS.items()}.get(title, title)


@dataclass(frozen=True)
class Cell:
    """One quantity of one column as text; empty where there is no value."""

    measured: str
    published: str
    best: bool
    part: str = ""  # "14 of 15" where it is of fewer scenes than there are

    @property
    def shown(self) -> str:
        """What is measured, with the scenes that it is of where some are missing."""
        return f"{self.measured} ({self.part})" if self.part else self.measured


@dataclass(frozen=True)
class Row:
    cost: str
    extra: bool
    cells: list[Cell]
    won: str  # "scenes won/scenes", empty where not counted


@dataclass(frozen=True)
class Block:
    """The lines of one data set, region and matcher."""

    dataset: str
    region: str
    matcher: str  # its title
    scenes: int
    rows: list[Row]


def format_number(value: float, decimals: int) -> str:
    """The number with so many decimals, empty for NaN."""
    return "" if value != value else f"{value:.{decimals}f}"


def format_error(value: float, decimals: int) -> str:
    """An error with so many decimals, ∞ where the run failed."""
    return f"{value:.{decimals}f}".replace("inf", "∞")


def format_estimate(median: float, low: float, high: float, decimals: int) -> str:
    """A median and its interval; – without one, ∞ where the run in the middle failed."""
    if median != median:
        return "–"
    shown = (format_error(value, decimals) for value in (median, low, high))
    return "{} [{}, {}]".format(*shown)


def write_csv(frame: pd.DataFrame, path: Path) -> None:
    """Writes a CSV file with numbers of four decimals; the paper's values as printed there."""
    shown = frame.copy()
    for name in shown.columns[shown.dtypes == float]:
        decimals = 2 if name == "published" else 4
        shown[name] = [format_number(value, decimals) for value in shown[name]]
    shown.to_csv(path, index=False)


def _best(block: pd.DataFrame, main: list[str]) -> dict[str, float]:
    """Least measured value of each error among those of the paper's columns that have all scenes."""
    whole = block["scenes"] == block["scenes"].max()
    errors = block[whole & block["cost"].isin(main) & (block["quantity"] != "invalid_pct")]
    return errors.groupby("quantity")["measured"].min().to_dict()


def _cell(values: pd.DataFrame, quantity: str, best: dict[str, float], scenes: int) -> Cell:
    if quantity not in values.index:
        return Cell("", "", False)
    measured, published, own = values.loc[quantity, ["measured", "published", "scenes"]]
    is_best = own == scenes and measured == best.get(quantity)
    part = f"{own:.0f} of {scenes}" if 0 < own < scenes else ""
    return Cell(format_number(measured, 2), format_number(published, 2), is_best, part)


def _won(wins: pd.DataFrame, cost: str) -> str:
    """Scenes won in mean error."""
    line = wins[(wins["cost"] == cost) & (wins["quantity"] == "mean_px")]
    return "" if line.empty else f"{line['won'].item()}/{line['scenes'].item()}"


def make_blocks(
    frame: pd.DataFrame, wins: pd.DataFrame, quantities: list[str], main: list[str]
) -> list[Block]:
    """Cuts a table's lines into one block per data set, region and matcher.

    @param wins scenes won per column; may be empty.
    @param main the paper's own columns.
    """
    blocks = []
    keys = ["dataset", "region", "matcher"]
    for (dataset, region, matcher), block in frame.groupby(keys, sort=False):
        best, scenes = _best(block, main), int(block["scenes"].max())
        own_wins = wins[(wins[keys] == [dataset, region, matcher]).all(axis="columns")]
        rows = []
        for cost, lines in block.groupby("cost", sort=False):
            values = lines.set_index("quantity")
            cells = [_cell(values, quantity, best, scenes) for quantity in quantities]
            rows.append(Row(cost, cost not in main, cells, _won(own_wins, cost)))
        title = matcher_title(matcher)
        blocks.append(Block(dataset, region, title, scenes, rows))
    return blocks


def flatten(options: dict, prefix: str = "") -> list[str]:
    """A map of options as texts `key value`, nested keys dotted."""
    texts = []
    for key, value in options.items():
        nested = isinstance(value, dict)
        texts += flatten(value, f"{prefix}{key}.") if nested else [f"{prefix}{key} {value}"]
    return texts


LATEX = {
    **{character: f"\\{character}" for character in "&%$#_{}"},
    **{"\\": "\\textbackslash{}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}"},
    **{"∞": "$\\infty$", "–": "--", "−": "$-$", "×": "$\\times$", "°": "$^\\circ$", "ε": "$\\varepsilon$"},
    **{"≥": "$\\geq$", "≤": "$\\leq$", "α": "$\\alpha$", "σ": "$\\sigma$", "τ": "$\\tau$", "√": "$\\surd$"},
    **{"∂": "$\\partial$", "∇": "$\\nabla$", "‖": "$\\Vert$", "ᵀ": "$^\\top$", "′": "$'$", "⁴": "$^4$", "⁻": "$^-$"},
    **{"²": "$^2$", "½": "$\\frac12$", "·": "$\\cdot$", "…": "\\dots{}"},
    **{character: f"${character}$" for character in "<>|"},
}


def _latex(text: object) -> str:
    return "".join(LATEX.get(character, character) for character in str(text))


def _latex_prose(text: object) -> str:
    """Escaped text; e_sgf and its kin become symbols, names in back ticks typewriter text."""
    marked = re.sub(r"\be\\_([a-z]+\d?)\b", r"$e_\\mathrm{\1}$", _latex(text))
    return re.sub(r"`([^`]+)`", r"\\texttt{\1}", marked)


def _html_prose(text: object) -> markupsafe.Markup:
    """As _latex_prose() for a web page."""
    marked = re.sub(r"\be_([a-z]+\d?)\b", r"<i>e</i><sub>\1</sub>", str(markupsafe.escape(text)))
    return markupsafe.Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", marked))


def render(template: str, **context: object) -> str:
    """Fills a template of paper/templates."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(paths.PAPER / "templates"),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(["html.j2"], default=False),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["latex"] = _latex
    environment.filters["latex_prose"] = _latex_prose
    environment.filters["html_prose"] = _html_prose
    environment.filters["matcher"] = matcher_title
    environment.filters["matcher_name"] = matcher_name
    return environment.get_template(template).render(**context)
