"""same_results.py with stand-ins for reproduce.sh and for the cluster."""

import os
import shutil
import signal
import subprocess
import time

import pytest

from conftest import HERE, PROJECT

# What it was told goes to a log; some seconds later there is a table, a figure and what that took, of each experiment.
REPRODUCE = """#!/bin/bash
echo "reproduce.sh $* ${SLURM_CONF##*/}" >>"$CALLS"
cd "$(dirname "$0")/results" || exit
[[ ! -e ../fail ]] || exit 1
sleep "$TAKES"
mkdir -p tables figures
for name in "$@"; do
  [[ $name != -* && $name != slurm ]] || continue
  echo "made of $name" | tee "tables/$name.csv" >"figures/$name.png"
  date +%N >"tables/${name}_timings.csv"
done
"""
CLUSTER = """#!/bin/bash
echo "cluster $1" >>"$CALLS"
"""


class Clone:
    """Undisturbed results, and the script beside stand-ins."""

    def __init__(self, root):
        self.root, self.results, self.log = root, root / "results", root / "calls"
        self.disturbed = root / "build" / "disturbed_results"
        tests = root / "tests" / "e2e"
        tests.mkdir(parents=True)
        self.script = shutil.copy2(HERE / "same_results.py", tests)
        for file, text in ((root / "reproduce.sh", REPRODUCE), (tests / "one_node_slurm.sh", CLUSTER)):
            file.write_text(text)
            file.chmod(0o755)
        (root / "paper").symlink_to(PROJECT / "paper")
        (self.results / "reference").mkdir(parents=True)
        (self.results / "reference" / "table1.csv").write_text("of a reference run")
        subprocess.run([root / "reproduce.sh", "fig2", "table1"], check=True, env=self.environment(0))
        self.log.unlink()

    def environment(self, seconds):
        return {**os.environ, "CALLS": str(self.log), "TAKES": str(seconds)}

    def start(self, *arguments, seconds=0):
        return subprocess.Popen([self.script, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                env=self.environment(seconds))

    def run(self, *arguments, seconds=0):
        process = self.start(*arguments, seconds=seconds)
        output, _ = process.communicate(timeout=300)
        return process.returncode, output

    def calls(self):
        return self.log.read_text().splitlines() if self.log.exists() else []


def content(folder):
    """All files of a folder with their bytes, but for the lock."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.name != ".lock"]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture
def clone(tmp_path):
    return Clone(tmp_path / "a clone")


def test_a_killed_run_is_compared_and_the_results_are_put_back(clone):
    before = content(clone.results)
    code, output = clone.run("kills", "2", "--within", "0.5", "fig2", "table1", seconds=2)
    assert code == 0, output
    assert "with all that it had started: 1 of 2" in output and "alone: 2 of 2" in output
    assert "4 files were made, 0 differ" in output
    assert set(clone.calls()) == {"reproduce.sh --only fig2 table1 "}
    assert content(clone.results) == before
    after = content(clone.disturbed)
    assert after.keys() >= before.keys()
    assert after["tables/fig2_timings.csv"] != before["tables/fig2_timings.csv"]


def test_what_differs_is_named(clone):
    tables = clone.results / "tables"
    with (tables / "fig2.csv").open("a") as file:
        file.write("a line more\n")
    (tables / "fig2_more.csv").touch()
    (tables / "table1.csv").unlink()  # of an experiment that is not asked for
    code, output = clone.run("kills", "0", "fig2")
    assert code == 1 and [line for line in output.splitlines() if "DIFFERS" in line] == [
        "DIFFERS: tables/fig2.csv", "DIFFERS: tables/fig2_more.csv"]


def test_a_failed_run_is_no_success(clone):
    before = content(clone.results)
    (clone.root / "fail").touch()
    code, output = clone.run("kills", "0", "fig2")
    assert code == 1 and output.endswith("Error: the disturbed run failed\n")
    assert content(clone.results) == before


def test_a_run_that_was_not_disturbed_is_no_success(clone):
    code, output = clone.run("kills", "1", "--within", "1000", "fig2")
    assert code == 1 and "== it ended before kill 1" in output


def test_ended_early_it_leaves_nothing_at_work_and_puts_the_results_back(clone):
    before = content(clone.results)
    process = clone.start("kills", "1", "--within", "100000", "fig2", seconds=1000)
    while not clone.calls():
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=300)  # until none is left to print
    assert process.returncode == 128 + signal.SIGTERM
    assert content(clone.results) == before


def test_killed_it_puts_the_results_back_when_called_again(clone):
    before = content(clone.results)
    clone.disturbed.parent.mkdir()
    clone.results.rename(clone.root / "build" / "undisturbed_results")
    assert clone.run("kills", "0", "table2") == (1, f"Error: not made in {clone.results}: table2\n")
    assert content(clone.results) == before


def test_a_run_on_a_cluster_is_compared_and_the_cluster_ended(clone):
    code, output = clone.run("slurm", "fig2")
    assert code == 0 and "2 files were made, 0 differ" in output
    assert clone.calls() == ["cluster up", "reproduce.sh --cluster slurm --only fig2 slurm.conf", "cluster down"]
    (clone.root / "fail").touch()
    assert clone.run("slurm", "fig2")[0] == 1
    assert clone.calls()[-1] == "cluster down"
