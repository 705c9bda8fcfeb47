"""same_results.py in a copy of the project with stand-ins for the programs."""

import os
import shutil
import signal
import subprocess

import pytest

from conftest import HERE
from same_results import made

STAGES = ["fig2", "table1"]


def content(results):
    """All files of a folder with their bytes, but for caches and logs."""
    files = [path for path in results.rglob("*") if path.is_file() and not path.relative_to(results).parts[0][0] == "."]
    return {path.relative_to(results): path.read_bytes() for path in files}


class Comparison:
    """The script in a project with undisturbed results."""

    def __init__(self, project):
        self.project = project
        self.script = project.root / "tests" / "e2e" / "same_results.py"
        self.script.parent.mkdir(parents=True)
        for name in ("same_results.py", "one_node_slurm.sh"):
            shutil.copy2(HERE / name, self.script.parent)
        code, output = project.run("--only", *STAGES)
        assert code == 0, output
        self.reference = project.results / "reference" / "table1.csv"
        self.reference.parent.mkdir()
        self.reference.write_text("of a reference run")

    def start(self, *arguments):
        return subprocess.Popen([self.script, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                env=self.project.environment(SGF_FAKE_SECONDS="0.1"))

    def run(self, *arguments):
        process = self.start(*arguments)
        output, _ = process.communicate(timeout=300)
        return process.returncode, output


@pytest.fixture
def comparison(project):
    return Comparison(project)


def test_a_killed_run_is_compared_and_the_results_are_put_back(comparison):
    project = comparison.project
    before = content(project.results)
    code, output = comparison.run("kills", "2", "--within", "6", *STAGES)
    assert code == 0, output
    count = len(made(project.results))
    assert "with all that it had started: 1 of 2" in output and f"{count} files were made, 0 differ" in output
    assert content(project.results) == before
    disturbed = project.root / "build" / "disturbed_results"
    assert made(disturbed) == made(project.results)
    assert (disturbed / "reference" / "table1.csv").read_text() == "of a reference run"


def test_what_differs_is_named(comparison):
    tables = comparison.project.results / "tables"
    with (tables / "fig2.csv").open("a") as file:
        file.write("a line more\n")
    (tables / "fig2_more.csv").touch()
    (tables / "table1.csv").unlink()  # of an experiment that is not asked for
    code, output = comparison.run("kills", "0", "fig2")
    assert code == 1, output
    assert [line for line in output.splitlines() if "DIFFERS" in line] == [
        "DIFFERS: tables/fig2.csv", "DIFFERS: tables/fig2_more.csv"]


def test_a_failed_run_is_no_success(comparison):
    (comparison.project.root / "fail_build").touch()
    code, output = comparison.run("kills", "0", "fig2")
    assert code == 1 and output.endswith("Error: the disturbed run failed\n")
    assert made(comparison.project.results)


def test_a_run_that_was_not_disturbed_is_no_success(comparison):
    code, output = comparison.run("kills", "1", "--within", "100000", "fig2")
    assert code == 1 and "== it ended before kill 1" in output, output


def test_ended_early_it_puts_the_results_back(comparison):
    project = comparison.project
    before, calls = content(project.results), len(project.calls())
    process = comparison.start("kills", "1", "--within", "1000", "--seed", "3", *STAGES)
    project.wait_for_calls(calls + 1)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert content(project.results) == before


def test_killed_it_puts_the_results_back_when_called_again(comparison):
    project = comparison.project
    before = content(project.results)
    (project.root / "build" / "undisturbed_results").parent.mkdir(exist_ok=True)
    project.results.rename(project.root / "build" / "undisturbed_results")
    code, output = comparison.run("kills", "0", "table2")
    assert (code, output) == (1, f"Error: not made in {project.results}: table2\n")
    assert content(project.results) == before


@pytest.mark.xdist_group("slurm")  # one cluster at a time
def test_a_run_on_a_cluster_is_compared(comparison):
    if os.getuid() != 0 or not shutil.which("slurmctld", path="/usr/sbin"):
        pytest.skip("takes root and Debian's slurm-wlm and munge")
    code, output = comparison.run("slurm", "fig2")
    assert code == 0 and ", 0 differ;" in output, output
    assert list((comparison.project.root / "build" / "disturbed_results" / "logs" / "slurm").glob("*.log"))
