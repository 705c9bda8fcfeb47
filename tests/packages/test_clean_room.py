"""tests/clean_room.sh with stand-ins for what makes and runs images, and what images say of their revision."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
SCRIPT = PROJECT / "tests" / "clean_room.sh"
USED = ("bash", "env", "cat", "dirname", "realpath", "sort", "grep")  # before it begins
STEPS = ("table1", "run", "verify", "packages", "test")
NEEDED = ("apt-get", "buildah", "debootstrap", "flock", "git", "unshare")


def clean_room(*arguments, **environment):
    done = subprocess.run([SCRIPT, *arguments], capture_output=True, text=True, check=False, timeout=60,
                          env=os.environ | environment)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def machine(tmp_path):
    """A PATH with what the script needs, in which nothing does anything; the user is root."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in USED:
        (folder / name).symlink_to(shutil.which(name))
    for name in NEEDED:
        (folder / name).write_text("#!/bin/sh\n")
    (folder / "id").write_text("#!/bin/sh\necho 0\n")
    for file in folder.iterdir():
        if not file.is_symlink():
            file.chmod(0o755)
    return folder


@pytest.mark.parametrize("arguments, message", [
    (["table9"], "unknown option or step 'table9'"),
    (["--suite", "tiny"], "--suite needs full or smoke, not 'tiny'"),
    (["--suite"], "--suite needs full or smoke"),
    (["--data", "/nonexistent/data"], "data folder '/nonexistent/data' does not exist"),
    (["--work"], "--work needs a folder"),
    (["--suite", "smoke", "test"], "suite smoke has neither tests nor packages"),
    (["--suite", "smoke", "run", "packages"], "suite smoke has neither tests nor packages"),
])
def test_wrong_usage_ends_with_2(arguments, message):
    code, output = clean_room(*arguments)
    assert code == 2 and message in output and "--help" in output


def test_help_names_the_steps():
    code, output = clean_room("--help")
    assert code == 0 and all(f"\n  {step} " in output for step in (*STEPS, "--suite"))


@pytest.mark.parametrize("missing", NEEDED)
def test_a_missing_program_is_named(machine, missing):
    (machine / missing).unlink()
    assert clean_room(PATH=str(machine)) == (1, f"Error: {missing} is not installed\n")


def test_other_users_are_sent_away(machine):
    (machine / "id").write_text("#!/bin/sh\necho 1000\n")
    code, output = clean_room(PATH=str(machine))
    assert code == 1 and "need root" in output


def test_a_host_without_debians_lists_is_told_what_to_do(machine):
    code, output = clean_room(PATH=str(machine))
    assert code == 1 and "apt-get update" in output


# Programs by name. What buildah is told goes to a log; it has the base, but not the image.
STAND_INS = {
    "apt-get": "echo http://deb.debian.org/debian bookworm",
    "buildah": """shift 6
echo "$*" >>"$CALLS"
case $1 in
  from) echo bare ;;
  inspect) [[ $* == *debian* ]] ;;
  run) [[ -z $FAILING || $* != *"$FAILING"* ]] || { echo "it was told to fail"; exit 1; } ;;
esac""",
    "chown": "",
    "debootstrap": "",
    "git": """case "$*" in
  *rev-parse*) echo 1234abcd ;;
  *archive*) tar -c -C "$CLONE" . ;;
esac""",
    "id": "echo 0",
    "unshare": 'while [[ $1 == --* ]]; do shift; done; exec "$@"',
}


@pytest.fixture
def room(tmp_path):
    """Makes a clean room with stand-ins, and says what buildah was told to build and to run in it."""
    programs, clone, calls = (tmp_path / name for name in ("programs", "clone", "calls"))
    (clone / "results" / "tables").mkdir(parents=True)
    (clone / "results" / "tables" / "table1.csv").touch()
    programs.mkdir()
    for name, text in STAND_INS.items():
        (programs / name).write_text(f"#!/bin/bash\n{text}\n")
        (programs / name).chmod(0o755)

    def make(*arguments, failing=""):
        calls.write_text("")
        code, output = clean_room(*arguments, "--work", str(tmp_path / "work"), PATH=f"{programs}:/usr/bin:/bin",
                                  CALLS=str(calls), CLONE=str(clone), FAILING=failing)
        told = calls.read_text().splitlines()
        builds = [line for line in told if line.startswith("bud ")]
        return code, output, builds, [line.split(" project -- ")[1] for line in told if " project -- " in line]

    return make


def test_all_steps_are_taken_in_order_and_timed(room):
    code, output, builds, runs = room()
    assert code == 0, output
    taken = re.findall(r"^== (.*)\n  \d+ s; log: ", output, re.MULTILINE)
    assert taken == ["source", "image", "container", *STEPS]
    assert runs[:3] == ["./reproduce.sh --only table1", "./reproduce.sh", "./reproduce.sh --verify"]
    assert runs[-1] == "./reproduce.sh test"
    assert len(builds) == 1 and "--build-arg REVISION=1234abcd" in builds[0]


def test_steps_can_be_chosen_and_take_data(room, tmp_path):
    code, output, _, runs = room("--suite", "smoke", "verify", "run", "--data", str(tmp_path))
    assert code == 0, output
    assert runs == ["./reproduce.sh --data /data", "./reproduce.sh --verify"]
    assert room("--suite", "smoke")[3] == ["./reproduce.sh --only table1"]


def test_a_failing_step_is_the_last(room):
    code, output, _, runs = room("run", "verify", "test", failing="--verify")
    assert code == 1 and "it was told to fail" in output and "Error: verify failed" in output
    assert runs == ["./reproduce.sh", "./reproduce.sh --verify"]


@pytest.mark.parametrize("written, revision", [("1234-dirty\n", "1234-dirty"), (None, "unknown")])
def test_programs_know_the_revision_that_an_image_was_given(tmp_path, written, revision):
    (tmp_path / "cmake").mkdir()
    shutil.copy(PROJECT / "cmake" / "provenance.cc.in", tmp_path / "cmake")
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(sgf VERSION 1 LANGUAGES NONE)\n"
        f'include("{PROJECT}/cmake/SgfProvenance.cmake")\n')
    if written:
        (tmp_path / "REVISION").write_text(written)
    subprocess.run(["cmake", "-S", tmp_path, "-B", tmp_path / "build"], check=True, capture_output=True, timeout=60)
    assert f'"{revision}"' in (tmp_path / "build" / "provenance.cc").read_text()
