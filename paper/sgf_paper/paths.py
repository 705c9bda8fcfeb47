"""Where the project's files lie."""

from pathlib import Path

PAPER = Path(__file__).resolve().parent.parent
PROJECT = PAPER.parent
EXPERIMENTS = PAPER / "experiments"
SWEEPS = PAPER / "sweeps"
PUBLISHED = PAPER / "published.yaml"
CLAIMS = PAPER / "claims.yaml"
DEVIATIONS = PAPER / "deviations.yaml"
DEVIATIONS_TEXT = PROJECT / "docs" / "deviations.md"
REFERENCE = PROJECT / "results" / "reference"
RECIPES = PROJECT / "datasets" / "synthetic"
STEREO_LAYOUTS = PROJECT / "datasets" / "stereo_layouts.yaml"
