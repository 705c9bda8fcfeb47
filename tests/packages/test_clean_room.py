"""tests/clean_room.sh, up to where it would begin."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "clean_room.sh"
USED = ("bash", "env", "cat", "dirname", "realpath", "sort", "grep")  # before it begins
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
])
def test_wrong_usage_ends_with_2(arguments, message):
    code, output = clean_room(*arguments)
    assert code == 2 and message in output and "--help" in output


def test_help_names_the_steps():
    code, output = clean_room("--help")
    assert code == 0 and all(step in output for step in ("table1", "packages", "test", "--suite SUITE"))


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
