"""The YAML files of paper/experiments as typed objects.

Reading is strict: an unknown or a missing key, a value of another type, or a name that leads nowhere, is a ConfigError
that names the file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from sgf_paper import paths
from sgf_paper.experiment import Experiment
from sgf_paper.report_config import Report
from sgf_paper.stereo_config import Benchmark, Density, DisparityFigure, LightChange, Table
from sgf_paper.strict_yaml import ConfigError, build, read_yaml
from sgf_paper.study_config import ContactSheet, Convergence, SelfMatch, SemiDense, Sequences, ShiftProfile
from sgf_paper.tracking_config import (
    DirectMap, JoinedTable, MrptMap, Odometry, TrackingTuning, TrajectoryTable, build_tuning,
)  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """What an experiment of a kind is, and what it makes: tables and figures of its name with one of these ends."""

    type: Any  # for build()
    tables: tuple[str, ...] = (".csv", ".md")
    figures: tuple[str, ...] = (".png", ".pdf")
    others: str = ""  # what it makes besides, for the summary; the Snakefile knows the files
    main_file: str = "tables/{name}.csv"  # whose presence and time say whether and when an experiment was made

    def files(self, name: str) -> list[str]:
        """Tables and figures of an experiment, below the results."""
        return [f"tables/{name}{end}" for end in self.tables] + [f"figures/{name}{end}" for end in self.figures]


KINDS = {
    "benchmark": Kind(Benchmark, figures=()),
    "contact_sheet": Kind(ContactSheet, tables=(), main_file="figures/{name}.png"),
    "convergence": Kind(Convergence),
    "density": Kind(Density, (".csv", "_equal.csv", ".md")),
    "direct_map": Kind(DirectMap),
    "disparity_figure": Kind(DisparityFigure, tables=(), main_file="figures/{name}.png"),
    "joined_table": Kind(JoinedTable, (".csv", "_light.csv", "_timings.csv", ".md", ".tex")),
    "light_change": Kind(LightChange),
    "mrpt_map": Kind(MrptMap),
    "odometry": Kind(Odometry, (".csv", "_compared.csv", "_runs.csv", ".md")),
    "report": Kind(
        Report,
        ("_verdicts.csv", "_claims.csv", "_values.csv", "_pairs.csv"),
        figures=(),
        others="{name}.html, {name}.pdf",
        main_file="{name}.html",
    ),
    "self_match": Kind(SelfMatch, (".csv", "_curves.csv", ".md"), (".png", ".pdf", "_curves.png", "_curves.pdf")),
    "semi_dense": Kind(SemiDense),
    "sequences": Kind(Sequences),
    "shift_profile": Kind(ShiftProfile, (".csv", "_minima.csv")),
    "table": Kind(Table, (".csv", "_tuned.csv", "_scenes.csv", "_wins.csv", ".md", ".tex"), figures=()),
    "trajectory_table": Kind(
        TrajectoryTable, (".csv", "_compared.csv", "_ate_compared.csv", "_runs.csv", ".md", ".tex")
    ),
    "tuning": Kind(Annotated[TrackingTuning, build_tuning], figures=(), others="{folder}/*.yaml"),
}


def load_experiment(name: str) -> Experiment:
    """Reads paper/experiments/<name>.yaml; its `kind` says what it is."""
    path = paths.EXPERIMENTS / f"{name}.yaml"
    node, where = read_yaml(path), str(path)
    kind = str(node.get("kind"))
    if kind not in KINDS:
        raise ConfigError(f"{where}: kind is '{kind}'; known: {', '.join(KINDS)}")
    return build(KINDS[kind].type, node, where)


def load_all() -> dict[str, dict[str, Any]]:
    """All experiments by kind and name; none of a kind that has none."""
    every: dict[str, dict[str, Any]] = {kind: {} for kind in KINDS}
    for path in sorted(paths.EXPERIMENTS.glob("*.yaml")):
        experiment = load_experiment(path.stem)
        every[experiment.kind][experiment.name] = experiment
    return every


def load_experiments(kind: str) -> dict[str, Any]:
    """All experiments of one kind by name."""
    return load_all()[kind]
