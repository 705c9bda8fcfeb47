"""Views of all synthetic scenes on one sheet, a row a scene."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from sgf_paper import config
from sgf_paper.study_config import ContactSheet
from sgf_paper.style import plt, save


def draw(sheet: ContactSheet, pairs: Path) -> plt.Figure:
    columns = max(len(names) for names in sheet.scenes.values())
    figure, axes = plt.subplots(
        len(sheet.scenes), columns, figsize=(2.2 * columns, 1.5 * len(sheet.scenes)), squeeze=False
    )
    for row, (scene, names) in zip(axes, sheet.scenes.items()):
        for axis in row:
            axis.axis("off")
        for axis, name in zip(row, names):
            axis.imshow(np.asarray(Image.open(pairs / f"{scene}_{name}" / "view.png")))
            axis.set_title(f"{scene}: {name}".replace("_", " "), fontsize=6, pad=2)
    figure.tight_layout(pad=0.3)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="of the experiment")
    parser.add_argument("--pairs", type=Path, required=True, help="folder of the pairs")
    parser.add_argument("--out", type=Path, required=True, help="folder for the figure")
    arguments = parser.parse_args()
    sheet = config.load_experiment(arguments.name)
    save(draw(sheet, arguments.pairs), arguments.out, arguments.name)


if __name__ == "__main__":
    main()
