"""Figures: the same bytes at any time."""

import time

from sgf_paper import style


def draw():
    figure, axis = style.plt.subplots()
    axis.plot([1, 2], label="a")
    axis.legend()
    return figure


def test_a_figure_made_twice_is_the_same_bytes(tmp_path):
    made = []
    for _ in range(2):
        style.save(draw(), tmp_path, "figure")
        made.append({path.name: path.read_bytes() for path in tmp_path.iterdir()})
        time.sleep(1.1)  # dates in PDF files count seconds
    assert made[0] == made[1] and sorted(made[0]) == ["figure.pdf", "figure.png"]
    assert b"/CreationDate" not in made[0]["figure.pdf"] and b"tIME" not in made[0]["figure.png"]
