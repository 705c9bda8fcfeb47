"""Copies of the project in which reproduce.sh runs with stand-ins for the programs and for apt."""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent.parent


def write_pair(folder):
    """A tiny pair in Middlebury's layout; calib.txt comes last, as debian_pairs.py writes it."""
    folder.mkdir(parents=True)
    grey = Image.fromarray((np.arange(600) % 251).astype(np.uint8).reshape(20, 30))
    for name in ("im0.png", "im1.png"):
        grey.save(folder / name)
    truth = np.linspace(1, 9, 600, dtype="<f4").tobytes()
    (folder / "disp0GT.pfm").write_bytes(b"Pf\n30 20\n-1\n" + truth)
    (folder / "calib.txt").write_text("width=30\nheight=20\nndisp=16\n")


def main_columns(sweep):
    """The paper's columns of a sweep's YAML map."""
    return {name: node for name, node in sweep["columns"].items() if not node.get("extra", False)}


def drop_extra_columns(file):
    """Keeps the paper's columns of a sweep: enough to see what is made, and sooner made."""
    sweep = yaml.safe_load(file.read_text())
    sweep["columns"] = main_columns(sweep)
    file.write_text(yaml.safe_dump(sweep, default_flow_style=None, sort_keys=False))


def write_experiment(file, study):
    """Writes an experiment; reproduce.sh reads its title in double quotes, and `by_name_only` in a line."""
    title = study.pop("title")
    file.write_text(f'title: "{title}"\n{yaml.safe_dump(study, sort_keys=False)}')


def shorten_runs(file, kept, baseline="photo"):
    """Keeps some of the rendered sequences, two columns, two conditions, and one run."""
    study = yaml.safe_load(file.read_text())
    rendered = [name for name, sequence in study["sequences"].items() if "rendered" in sequence]
    study["conditions"].pop("local_light", None)
    for name in set(rendered) - set(kept):
        del study["sequences"][name]
        for condition in study["conditions"].values():
            condition.get("changes", {}).pop(name, None)
    study |= {"runs": 1, "compared": ["sgf"], "baselines": [baseline]}
    study["columns"] = {name: study["columns"][name] for name in ("sgf", baseline)}
    write_experiment(file, study)


def shorten_tuning(experiments):
    """Keeps those of the table's sequences and columns that are kept there, and a few trials."""
    table = yaml.safe_load((experiments / "table3_vio.yaml").read_text())
    for name in ("tune", "tune_tiny"):
        file = experiments / f"{name}.yaml"
        tuning = yaml.safe_load(file.read_text())
        for index, fold in enumerate(tuning.get("folds", [])):
            tuning["folds"][index] = [sequence for sequence in fold if sequence in table["sequences"]]
        tuning["budget"] |= {"trials": 3, "runs": 1, "held_out_runs": 1}
        tuning |= {"columns": ["sgf"]}
        write_experiment(file, tuning)


class Project:
    """One copy of the project and ways to run its reproduce.sh."""

    def __init__(self, root):
        self.root = root / "a project"  # a blank, which paths must survive
        self.log = root / "calls.log"
        self.results = self.root / "results"
        self.bin = self.root / "build" / "release" / "bin"
        self.data = root / "my data"
        self._copy()
        for name in ("Motorcycle", "Aloe"):
            write_pair(self.root / "datasets" / "generated" / "debian_pairs" / name)

    def _copy(self):
        ignore = shutil.ignore_patterns("__pycache__", "generated")
        for folder in ("paper", "datasets"):
            shutil.copytree(PROJECT / folder, self.root / folder, ignore=ignore)
        (self.root / "docs").mkdir()
        for file in ("reproduce.sh", "packages.apt", "docs/deviations.md"):
            shutil.copy2(PROJECT / file, self.root / file)
        for sweep in (self.root / "paper" / "sweeps").iterdir():
            drop_extra_columns(sweep)
        experiments = self.root / "paper" / "experiments"
        shorten_runs(experiments / "odometry.yaml", ["V1_03_difficult"])
        for name in ("odometry_parts", "table3_dso"):
            shorten_runs(experiments / f"{name}.yaml", ["MH_03_medium"])
        shorten_runs(experiments / "table3_vio.yaml", ["MH_01_easy", "MH_03_medium"], "lssd")
        shorten_tuning(experiments)
        light_change = experiments / "light_change.yaml"
        light_change.write_text(light_change.read_text().replace(", census]", "]"))

    def environment(self, **more):
        kept = {k: v for k, v in os.environ.items() if not k.startswith("SGF_")}
        return {
            **kept,
            "PATH": f"{HERE / 'stubs'}:/usr/bin:/bin",
            "FAKES": str(HERE / "fakes"),
            "STUB_LOG": str(self.log),
            "STUB_FAIL_BUILD": str(self.root / "fail_build"),
            "PYTHONPATH": "/nonexistent",
            **more,
        }

    def start(self, *arguments, **environment):
        """Starts reproduce.sh as the leader of its own process group; SIGINT is heard even where these tests were told not to."""
        return subprocess.Popen(
            ["/usr/bin/env", "--default-signal=INT", self.root / "reproduce.sh", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            text=True,
            env=self.environment(**environment),
            start_new_session=True,
        )

    def run(self, *arguments, **environment):
        """Runs reproduce.sh; its exit code and what it printed."""
        process = self.start(*arguments, **environment)
        output, _ = process.communicate(timeout=600)
        return process.returncode, output

    def calls(self):
        """`data set sweep/column` for each column that the stand-in for sgf_eval has scored."""
        file = self.bin / "calls"
        return file.read_text().splitlines() if file.exists() else []

    def renderings(self):
        """Commands of the stand-in for sgf_render, and the pairs and sequences it has made."""
        file = self.bin / "renderings"
        return file.read_text().splitlines() if file.exists() else []

    def trackings(self):
        """`sequence residual seed` and further notes of each run of the stand-in for sgf_align."""
        file = self.bin / "trackings"
        return file.read_text().splitlines() if file.exists() else []

    def flights(self):
        """`sequence residual seed` and the way back allowed of each run of the stand-in for sgf_vio."""
        file = self.bin / "flights"
        return file.read_text().splitlines() if file.exists() else []

    def fail(self, what):
        """Has a column `sweep/column` of sgf_eval or a command of sgf_render fail; None: no more."""
        self.bin.mkdir(parents=True, exist_ok=True)
        (self.bin / "fail").write_text(what or "")

    def stub_log(self):
        return self.log.read_text() if self.log.exists() else ""

    def add_dataset(self, name, scenes):
        for scene in scenes:
            (self.data / name / scene).mkdir(parents=True)

    def wait_for_calls(self, count, calls=None):
        """Waits until so many columns have begun, or other calls."""
        deadline = time.time() + 120
        while len((calls or self.calls)()) < count:
            assert time.time() < deadline, "nothing was begun"
            time.sleep(0.05)


def stop(process, number):
    """Sends a signal to a whole process group, as a terminal does, and waits for its end."""
    os.killpg(process.pid, number)
    output, _ = process.communicate(timeout=120)
    return process.returncode, output


@pytest.fixture
def interrupt():
    return lambda process: stop(process, signal.SIGINT)


@pytest.fixture
def kill():
    return lambda process: stop(process, signal.SIGKILL)


@pytest.fixture
def project(tmp_path):
    return Project(tmp_path)
