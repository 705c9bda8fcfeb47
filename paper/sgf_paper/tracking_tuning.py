"""Two-fold cross-validation over sequences: options found on one fold are scored on the other.

Every column of a trajectory table gets the same trials within the same ranges; the first one has the
program's defaults. Trials are kept in a database: what was tried before a run was stopped is not tried
again. A trial's value is the mean over its runs of the logarithm of the error in percent of the path, where
a run that fails has the error beyond which runs fail. So a sequence with large errors counts no more than
others, and a failure as much as the worst success, which leaves the search a slope.
"""

from __future__ import annotations

import argparse
import fcntl
import hashlib
import json
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import yaml
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution
from optuna.trial import FrozenTrial, TrialState

from sgf_paper import config, odometry_scores, paired
from sgf_paper.strict_yaml import ConfigError, read_yaml
from sgf_paper.tracking_config import SearchRange, TrackingTuning

DIGITS = 3  # of the options that are tried, so that what is written is what was run
LOCK_SECONDS = 120  # that a job waits for others at the database

Options = dict[str, Any]


class TuningError(Exception):
    """A program that failed; the text is its own."""


@dataclass(frozen=True)
class Tracker:
    """The program of a column on rendered sequences, and what scores it."""

    tuning: TrackingTuning
    column: str
    program: Path
    scorer: Path  # sgf_eval
    suite: Path  # folder of the rendered sequences

    def folder_of(self, sequence: str) -> Path:
        """Where a sequence lies."""
        return self.tuning.table.sequences[sequence].path(self.suite, "")

    def command(self, sequence: str, condition: str, run: int, options: Options) -> list[str]:
        """The command line of a run but for its results' folder."""
        folder = self.folder_of(sequence)
        flags = self.tuning.flags(sequence, folder, condition, self.column, run, options)
        return [str(self.program), str(folder), *flags]

    def _start(self, command: list[str], out: Path) -> None:
        done = subprocess.run([*command, "-o", out], capture_output=True, text=True)
        if done.returncode:
            raise TuningError(f"{' '.join(command)}:\n{done.stdout}{done.stderr}")

    def options_of_run(self, sequence: str) -> dict[str, Any]:
        """What the program notes of a run with the column's own options: all its options, and its build."""
        with tempfile.TemporaryDirectory() as out:
            self._start(self.command(sequence, self.tuning.conditions[0], 0, {}), Path(out))
            return read_yaml(Path(out) / "options.yaml")

    def error_pct(self, sequence: str, condition: str, run: int, options: Options) -> float:
        """ATE RMSE in percent of the path; of a run that fails the error beyond which runs fail."""
        table = self.tuning.table
        with tempfile.TemporaryDirectory() as out:
            self._start(
                self.command(sequence, condition, run, options), Path(out) / condition / self.column
            )
            done = odometry_scores.read_run(table, Path(out), condition, self.column)
            if done.lost:
                return table.fail_above_pct
            scores = odometry_scores.Scorer(table, self.scorer, self.folder_of(sequence)).own_scores(done)
        error = 100 * scores["own_ate_m"] / scores["path_m"]
        return min(error, table.fail_above_pct) if scores["success_by_scale"] else table.fail_above_pct

    def cases(self, fold: int, runs: range) -> list[tuple[str, str, int]]:
        """Sequence, condition and run of all runs on a fold."""
        sequences, conditions = self.tuning.rendered(fold), self.tuning.conditions
        return [(name, condition, run) for name in sequences for condition in conditions for run in runs]

    def errors_pct(self, fold: int, runs: range, options: Options) -> list[float]:
        """The errors of all runs on a fold."""
        return [self.error_pct(*case, options) for case in self.cases(fold, runs)]


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def manifests(tracker: Tracker, fold: int) -> dict[str, str]:
    """What identifies the data of a fold: the hash of each folder's list of hashes."""
    names = tracker.tuning.rendered(fold)
    return {name: _sha256(tracker.folder_of(name) / "manifest.yaml") for name in names}


def study_name(tracker: Tracker, fold: int) -> str:
    """Names all that the trials on a fold depend on: another program, other data or ranges begin anew."""
    tuning = tracker.tuning
    runs = range(tuning.budget.runs)
    parts = [
        [_sha256(tracker.program), _sha256(tracker.scorer)],
        manifests(tracker, fold),
        [tracker.command(*case, {})[2:] for case in tracker.cases(fold, runs)],
        {name: asdict(span) for name, span in tuning.space.items()},
        [tuning.table.fail_above_pct, tuning.table.lost_below_pct, tuning.seed],
    ]
    digest = hashlib.sha256(json.dumps(parts).encode()).hexdigest()
    return f"{tracker.column} on {' '.join(tuning.rendered(fold))} {digest[:16]}"


def open_study(storage: Path, name: str) -> optuna.Study:
    """The study in the database, new or with the trials done before."""
    storage.parent.mkdir(parents=True, exist_ok=True)
    engine = {"connect_args": {"timeout": LOCK_SECONDS}}
    with storage.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # two jobs at once would both make the tables
        backend = optuna.storages.RDBStorage(f"sqlite:///{storage}", engine_kwargs=engine)
        return optuna.create_study(storage=backend, study_name=name, load_if_exists=True)


def _distribution(span: SearchRange) -> BaseDistribution:
    if span.integer:
        return IntDistribution(int(span.low), int(span.high), log=span.log)
    return FloatDistribution(span.low, span.high, log=span.log)


def rounded(tuning: TrackingTuning, options: Options) -> Options:
    """The options with as many digits as are tried, in the order of the space: a database has its own."""
    return {
        name: int(options[name]) if span.integer else float(f"{options[name]:.{DIGITS}g}")
        for name, span in tuning.space.items()
        if name in options
    }


def finished(study: optuna.Study) -> list[FrozenTrial]:
    """Trials with a value, in order: not those that were stopped."""
    return study.get_trials(deepcopy=False, states=[TrialState.COMPLETE])


def search(
    study: optuna.Study, tuning: TrackingTuning, defaults: Options, value_of: Callable[[Options], float]
) -> list[FrozenTrial]:
    """Makes the trials that are missing, the defaults first; all of the budget's trials.

    A trial follows from those finished before it, so a run that goes on finds what it would have found.
    """
    space = {name: _distribution(span) for name, span in tuning.space.items()}
    while (count := len(finished(study))) < tuning.budget.trials:
        if count == 0:
            value = value_of(defaults)
            study.add_trial(optuna.create_trial(params=defaults, distributions=space, value=value))
        else:
            study.sampler = optuna.samplers.TPESampler(seed=tuning.seed + count)
            trial = study.ask(space)
            value = value_of(rounded(tuning, trial.params))
            study.tell(trial, value)
        print(f"trial {count}: {np.exp(value):.4f} % of the path", flush=True)
    return finished(study)[: tuning.budget.trials]


def defaults_of(tuning: TrackingTuning, options: dict[str, Any]) -> Options:
    """The program's values of the options that are looked for. @param options all of them, nested."""
    defaults = {}
    for name, span in tuning.space.items():
        node = options
        for key in name.split("."):
            if key not in node:
                raise ConfigError(f"{tuning.name}: space: the program has no option {name}")
            node = node[key]
        if not span.low <= node <= span.high:
            raise ConfigError(f"{tuning.name}: space.{name}: the program's default, {node}, is outside")
        defaults[name] = node
    return rounded(tuning, defaults)


def _mean_log(errors_pct: list[float]) -> float:
    return float(np.mean(np.log(errors_pct)))


def _summary(tuning: TrackingTuning, errors_pct: list[float]) -> dict[str, Any]:
    failed = sum(error >= tuning.table.fail_above_pct for error in errors_pct)
    return {"error_pct": round(float(np.exp(_mean_log(errors_pct))), 4), "failed": failed}


def _held_out(tracker: Tracker, fold: int, defaults: Options, found: Options) -> dict[str, Any]:
    """The defaults and what was found on a fold that had no part in it, run by run."""
    budget = tracker.tuning.budget
    runs = range(budget.runs, budget.runs + budget.held_out_runs)
    before = tracker.errors_pct(fold, runs, defaults)
    after = before if found == defaults else tracker.errors_pct(fold, runs, found)
    # Under both conditions a run begins at the same frame.
    same_images = [(sequence, run) for sequence, _, run in tracker.cases(fold, runs)]
    ratio = paired.estimate_ratio(after, before, same_images)
    return {
        "runs": len(before),
        "default": _summary(tracker.tuning, before),
        "tuned": _summary(tracker.tuning, after),
        "ratio": {name: round(getattr(ratio, name), 4) for name in ("median", "low", "high")},
    }


def tune_fold(tracker: Tracker, storage: Path, fold: int, defaults: Options) -> dict[str, Any]:
    """Options for the sequences of a fold, found on the other fold, and what they are worth on both."""
    tuning, other = tracker.tuning, 1 - fold
    runs = range(tuning.budget.runs)
    study = open_study(storage, study_name(tracker, other))
    trials = search(
        study, tuning, defaults, lambda options: _mean_log(tracker.errors_pct(other, runs, options))
    )
    best = min(trials, key=lambda trial: trial.value)
    found = rounded(tuning, best.params)
    return {
        "used_for": tuning.folds[fold],
        "trained_on": tuning.rendered(other),
        "parameters": found,
        "trial": trials.index(best),
        "training": {
            "runs": len(tracker.cases(other, runs)),
            "default_pct": round(float(np.exp(trials[0].value)), 4),
            "tuned_pct": round(float(np.exp(best.value)), 4),
        },
        "held_out": _held_out(tracker, fold, defaults, found),
    }


def tune(tracker: Tracker, storage: Path) -> dict[str, Any]:
    """All that is written of a column."""
    tuning = tracker.tuning
    noted = tracker.options_of_run(tuning.rendered(0)[0])
    defaults = defaults_of(tuning, noted["options"])
    return {
        "column": tracker.column,
        "program": tuning.table.program(tracker.column),
        "experiment": tuning.name,
        "budget": asdict(tuning.budget),
        "conditions": tuning.conditions,
        "space": {name: asdict(span) for name, span in tuning.space.items()},
        "build": noted["build"],
        "optuna": optuna.__version__,
        "seed": tuning.seed,
        "data": manifests(tracker, 0) | manifests(tracker, 1),
        "defaults": defaults,
        "folds": [tune_fold(tracker, storage, fold, defaults) for fold in (0, 1)],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("column", help="of its table")
    parser.add_argument("--program", type=Path, required=True, help="the column's")
    parser.add_argument("--scorer", type=Path, required=True, help="sgf_eval")
    parser.add_argument("--suite", type=Path, required=True, help="folder of the rendered sequences")
    parser.add_argument("--storage", type=Path, required=True, help="database of the trials")
    parser.add_argument("--out", type=Path, required=True, help="YAML file to write")
    a = parser.parse_args()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    tracker = Tracker(config.load_experiment(a.name), a.column, a.program, a.scorer, a.suite)
    document = tune(tracker, a.storage)
    a.out.write_text(yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=100))


if __name__ == "__main__":
    main()
