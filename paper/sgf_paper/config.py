"""The YAML files of paper/experiments as typed objects.

Reading is strict: an unknown or a missing key, a value of another type, or a name that leads nowhere, is a ConfigError
that names the file.
"""

from __future__ import annotations

from typing import Annotated, Any, Union

from sgf_paper import paths
from sgf_paper.report_config import Report
from sgf_paper.stereo_config import Benchmark, Density, DisparityFigure, LightChange, Table
from sgf_paper.strict_yaml import ConfigError, build, read_yaml
from sgf_paper.study_config import ContactSheet, Convergence, SelfMatch, SemiDense, Sequences, ShiftProfile
from sgf_paper.tracking_config import (
    DirectMap, JoinedTable, MrptMap, Odometry, TrackingTuning, TrajectoryTable, build_tuning,
)  # fmt: skip

Experiment = Union[
    ContactSheet, Convergence, Sequences, Table, Density, DirectMap, LightChange, DisparityFigure, Benchmark,
    JoinedTable, MrptMap, Odometry, Report, SemiDense, SelfMatch, ShiftProfile, TrackingTuning, TrajectoryTable,
]

KINDS = {
    "benchmark": Benchmark,
    "contact_sheet": ContactSheet,
    "convergence": Convergence,
    "density": Density,
    "direct_map": DirectMap,
    "disparity_figure": DisparityFigure,
    "joined_table": JoinedTable,
    "light_change": LightChange,
    "mrpt_map": MrptMap,
    "odometry": Odometry,
    "report": Report,
    "self_match": SelfMatch,
    "semi_dense": SemiDense,
    "sequences": Sequences,
    "shift_profile": ShiftProfile,
    "table": Table,
    "trajectory_table": TrajectoryTable,
    "tuning": Annotated[TrackingTuning, build_tuning],
}


def load_experiment(name: str) -> Experiment:
    """Reads paper/experiments/<name>.yaml; its `kind` says what it is."""
    path = paths.EXPERIMENTS / f"{name}.yaml"
    node, where = read_yaml(path), str(path)
    kind = str(node.get("kind"))
    if kind not in KINDS:
        raise ConfigError(f"{where}: kind is '{kind}'; known: {', '.join(KINDS)}")
    return build(KINDS[kind], node, where)


def load_experiments(kind: str) -> dict[str, Any]:
    """All experiments of one kind by name."""
    every = (load_experiment(path.stem) for path in sorted(paths.EXPERIMENTS.glob("*.yaml")))
    return {experiment.name: experiment for experiment in every if experiment.kind == kind}
