"""The YAML files of paper/experiments as typed objects.

Reading is strict: an unknown or a missing key, or a name that leads nowhere, is a ConfigError that
names the file.
"""

from __future__ import annotations

from functools import partial
from typing import Any, Union

from sgf_paper import paths
from sgf_paper.report_config import Report, build_report
from sgf_paper.stereo_config import (
    Benchmark, Density, DisparityFigure, LightChange, Table, build_figure, build_light_change, build_table,
)  # fmt: skip
from sgf_paper.strict_yaml import ConfigError, build, read_yaml
from sgf_paper.study_config import (
    ContactSheet, Convergence, SelfMatch, SemiDense, Sequences, ShiftProfile, build_convergence, build_self_match,
    build_semi_dense,
)  # fmt: skip
from sgf_paper.tracking_config import (
    DirectMap, JoinedTable, MrptMap, Odometry, TrackingTuning, TrajectoryTable, build_direct_map, build_joined_table,
    build_odometry, build_on_sequences, build_trajectory_table, build_tuning,
)  # fmt: skip

Experiment = Union[
    ContactSheet, Convergence, Sequences, Table, Density, DirectMap, LightChange, DisparityFigure, Benchmark,
    JoinedTable, MrptMap, Odometry, Report, SemiDense, SelfMatch, ShiftProfile, TrackingTuning, TrajectoryTable,
]

BUILDERS = {
    "benchmark": partial(build, Benchmark),
    "contact_sheet": partial(build, ContactSheet),
    "convergence": build_convergence,
    "density": partial(build, Density),
    "direct_map": build_direct_map,
    "disparity_figure": build_figure,
    "joined_table": build_joined_table,
    "light_change": build_light_change,
    "mrpt_map": partial(build_on_sequences, MrptMap),
    "odometry": build_odometry,
    "report": build_report,
    "self_match": build_self_match,
    "semi_dense": build_semi_dense,
    "sequences": partial(build, Sequences),
    "shift_profile": partial(build, ShiftProfile),
    "table": build_table,
    "trajectory_table": build_trajectory_table,
    "tuning": build_tuning,
}


def load_experiment(name: str) -> Experiment:
    """Reads paper/experiments/<name>.yaml; its `kind` says what it is."""
    path = paths.EXPERIMENTS / f"{name}.yaml"
    node, where = read_yaml(path), str(path)
    kind = str(node.get("kind"))
    if kind not in BUILDERS:
        raise ConfigError(f"{where}: kind is '{kind}'; known: {', '.join(BUILDERS)}")
    return BUILDERS[kind](node, where)


def load_experiments(kind: str) -> dict[str, Any]:
    """All experiments of one kind by name."""
    every = (load_experiment(path.stem) for path in sorted(paths.EXPERIMENTS.glob("*.yaml")))
    return {experiment.name: experiment for experiment in every if experiment.kind == kind}
