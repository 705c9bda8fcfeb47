"""What all figures share."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402  (the backend comes first)
from matplotlib.axis import Axis  # noqa: E402
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter  # noqa: E402

# Colours that the colour-blind can tell apart (Okabe and Ito), one for each of the paper's columns.
COLOURS = {
    "orig": "#000000",
    "sad": "#E69F00",
    "agm": "#56B4E9",
    "pm": "#009E73",
    "sgf": "#D55E00",
}
EXTRA_COLOURS = ["#999999", "#CC79A7", "#0072B2", "#B8A000"]
EXTRA_DASHES = [(0, (4, 2)), (0, (1, 1)), (0, (6, 1, 1, 1))]

plt.rcParams.update({"font.size": 8, "axes.titlesize": 8, "figure.titlesize": 9, "pdf.fonttype": 42})


def line_style(column: str, extra_columns: list[str]) -> dict:
    """Colour, width and dashes of a column's line: solid for the paper's, dashed for extra ones."""
    if column in COLOURS:
        return {"color": COLOURS[column], "linewidth": 1.6, "zorder": 3}
    index = extra_columns.index(column)
    return {
        "color": EXTRA_COLOURS[index % len(EXTRA_COLOURS)],
        "linestyle": EXTRA_DASHES[index // len(EXTRA_COLOURS) % len(EXTRA_DASHES)],
        "linewidth": 1.0,
    }


def label_decades(axis: Axis) -> None:
    """Labels 1, 2 and 5 of each decade of a logarithmic axis as plain numbers."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def save(figure: plt.Figure, out: Path, name: str) -> None:
    """Writes <name>.png and <name>.pdf, the same bytes for the same content."""
    figure.savefig(out / f"{name}.png", dpi=200, metadata={"Software": None})
    figure.savefig(out / f"{name}.pdf", dpi=200, metadata={"CreationDate": None})
    plt.close(figure)
