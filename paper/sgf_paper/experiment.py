"""What all experiments have."""

from __future__ import annotations

from dataclasses import dataclass

from sgf_paper.stereo_datasets import Dataset


@dataclass
class Experiment:
    """A file of paper/experiments."""

    kind: str
    name: str
    title: str

    def has_data(self, datasets: dict[str, Dataset]) -> bool:
        """Whether any data that it can use are at hand: what is rendered always is."""
        return True
