"""What a run leaves of itself: run.json and timing.json."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sgf_paper import paths, record

PROGRAM = """#!/usr/bin/python3
import pathlib, sys
out = pathlib.Path(sys.argv[1])
out.mkdir(exist_ok=True)
(out / "trajectory.txt").write_text("1 2 3\\n")
(out / "options.yaml").write_text("options: {tau: .inf, change: {seed: 7}}\\n")
"""
TELLER = "#!/bin/sh\n[ $1 = build ] && echo 'simd: avx9'\n"


@pytest.fixture
def start(tmp_path):
    """Starts the recorder in a folder of its own."""

    def start(*words):
        environment = {**os.environ, "PYTHONPATH": str(paths.PAPER)}
        command = [sys.executable, "-m", "sgf_paper.record", *map(str, words)]
        return subprocess.Popen(command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True)

    return start


@pytest.fixture
def run(start):
    """Runs it to the end; its exit code and what it said on stderr."""

    def run(*words):
        process = start(*words)
        _, errors = process.communicate(timeout=120)
        return process.returncode, errors

    return run


def read(folder, name="run.json"):
    return json.loads((folder / name).read_text())


@pytest.fixture
def program(tmp_path):
    """A program beside an sgf_eval that knows the build."""
    for name, text in (("program", PROGRAM), ("sgf_eval", TELLER)):
        (tmp_path / "bin").mkdir(exist_ok=True)
        (tmp_path / "bin" / name).write_text(text)
        (tmp_path / "bin" / name).chmod(0o755)
    return tmp_path / "bin" / "program"


def test_a_run_leaves_what_it_depends_on_and_two_equal_runs_the_same_bytes(run, program, tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "image").write_text("grey")
    words = ("a_rule", "out", "--inputs", program, "data", "--outputs", "out/trajectory.txt", "--", program, "out")
    assert run(*words)[0] == 0
    first = (tmp_path / "out" / "run.json").read_bytes()
    node = json.loads(first)
    assert (node["rule"], node["command"]) == ("a_rule", [str(program), "out"])
    assert node["options"] == {"options": {"tau": "inf", "change": {"seed": 7}}}
    assert node["seeds"] == {"options.change.seed": 7}
    assert node["build"] == {"simd": "avx9"}
    assert node["exit"] == {"state": "done", "code": 0}
    assert node["inputs"][str(program)] == hashlib.sha256(PROGRAM.encode()).hexdigest()
    line = f"{hashlib.sha256(b'grey').hexdigest()}  image\n"
    assert node["inputs"]["data"] == hashlib.sha256(line.encode()).hexdigest()
    assert node["outputs"] == {"out/trajectory.txt": hashlib.sha256(b"1 2 3\n").hexdigest()}
    assert "avx" in node["processor"]["flags"] or node["processor"]["architecture"] != "x86_64"
    assert run(*words)[0] == 0
    assert (tmp_path / "out" / "run.json").read_bytes() == first


def test_of_a_program_that_notes_none_the_options_are_all_files_it_was_given(run, tmp_path):
    sequence = "seed: 1\nimu: {seed: 101}\nshake: {shake_seed: 9}\n"
    recipes = {"MH_01": sequence, "pairs": "pairs: [{seed: 5}, {seed: 6}]\n"}
    (tmp_path / "synthetic").mkdir()
    for name, text in recipes.items():
        (tmp_path / "synthetic" / f"{name}.yaml").write_text(text)
    files = [f"synthetic/{name}.yaml" for name in recipes]
    assert run("rule", "out", "--inputs", *files, "other", "--", "true")[0] == 0
    node = read(tmp_path / "out")
    assert node["options"]["MH_01"]["imu"] == {"seed": 101} and len(node["options"]["pairs"]["pairs"]) == 2
    seeds = {"MH_01.seed": 1, "MH_01.imu.seed": 101, "MH_01.shake.shake_seed": 9}
    assert node["seeds"] == seeds | {"pairs.pairs.0.seed": 5, "pairs.pairs.1.seed": 6}


def test_the_build_is_asked_of_what_was_read_not_of_what_lies_beside_the_interpreter(run, program, tmp_path):
    assert run("rule", "out", "--", program, "out")[0] == 0
    assert read(tmp_path / "out")["build"] == {}


def test_time_and_memory_are_in_a_file_of_their_own(run, tmp_path):
    code = "b = bytearray(80 << 20)\nfor i in range(2000000): pass"
    assert run("rule", "out", "--", sys.executable, "-c", code)[0] == 0
    timing = read(tmp_path / "out", "timing.json")
    assert timing["peak_mib"] > 80 and 0 < timing["cpu_s"] and 0 < timing["wall_s"]
    assert not {"wall_s", "cpu_s", "peak_mib", "node"} & set(read(tmp_path / "out"))


@pytest.mark.parametrize(
    "script, code, state",
    [
        ("exit 3", 3, {"state": "failed", "code": 3}),
        ("kill -SEGV $$", 128 + signal.SIGSEGV, {"state": "killed", "signal": "SIGSEGV"}),
    ],
)
def test_a_failure_is_recorded_and_handed_on(run, tmp_path, script, code, state):
    assert run("rule", "out", "--", "sh", "-c", script)[0] == code
    assert read(tmp_path / "out")["exit"] == state
    assert (tmp_path / "out" / "timing.json").exists()


def wait_for(path):
    deadline = time.time() + 120
    while not path.exists():
        assert time.time() < deadline, f"{path} does not appear"
        time.sleep(0.02)


def test_a_signal_reaches_the_program_and_is_recorded(start, tmp_path):
    process = start("rule", "out", "--", "sh", "-c", "touch begun; exec sleep 100")
    wait_for(tmp_path / "begun")
    process.terminate()
    process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert read(tmp_path / "out")["exit"] == {"state": "killed", "signal": "SIGTERM"}


def test_what_is_killed_altogether_is_left_as_started(start, tmp_path):
    process = start("rule", "out", "--", "sh", "-c", "touch begun; exec sleep 1")
    wait_for(tmp_path / "begun")
    process.kill()
    process.communicate(timeout=60)
    assert read(tmp_path / "out")["exit"] == {"state": "started"}


def test_a_program_that_is_not_there_is_named(run):
    code, errors = run("rule", "out", "--", "/nonexistent/program")
    assert code == 1 and "/nonexistent/program" in errors
    assert run("rule", "out")[0] == 2


def test_what_is_large_is_hashed_once_until_it_changes(tmp_path, monkeypatch):
    hashed = []
    monkeypatch.setattr(record, "_hash_file", lambda path: hashed.append(path.name) or "0")
    monkeypatch.setattr(record, "CACHED_BYTES", 4)
    folder = tmp_path / "sequence"
    folder.mkdir()
    (folder / "a").write_bytes(b"12345")
    cache = tmp_path / "cache"
    first = record.hash_path(folder, cache)
    assert record.hash_path(folder, cache) == first and hashed == ["a"]
    (folder / "b").write_bytes(b"1")
    assert record.hash_path(folder, cache) != first and hashed == ["a", "a", "b"]


def git(folder, *words):
    settings = ("-c", "user.name=a", "-c", "user.email=a@b")
    subprocess.run(["git", "-C", folder, *settings, *words], check=True, capture_output=True)


def test_the_code_is_a_commit_and_what_differs_from_it(tmp_path, monkeypatch):
    project, diffs = tmp_path / "project", tmp_path / "diffs"
    project.mkdir()
    monkeypatch.setattr(record, "PROJECT", project)
    assert record.describe_code(diffs) == {"commit": "unknown", "diff": ""}
    (project / "REVISION").write_text("1234-dirty\n")
    assert record.describe_code(diffs) == {"commit": "1234-dirty", "diff": ""}
    (project / "REVISION").unlink()
    git(project, "init")
    (project / "code").write_text("1\n")
    git(project, "add", "code")
    git(project, "commit", "-m", "first")
    clean = record.describe_code(diffs)
    assert len(clean["commit"]) == 40 and clean["diff"] == ""
    (project / "code").write_text("2\n")
    (project / "new").touch()
    changed = record.describe_code(diffs)
    assert changed["commit"] == clean["commit"]
    patch = (diffs / f"{changed['diff']}.patch").read_text()
    assert "+2\n" in patch and f"# not in git: new {hashlib.sha256(b'').hexdigest()}\n" in patch
    (project / "new").write_text("3\n")
    assert record.describe_code(diffs)["diff"] != changed["diff"], "what git does not know counts by what it holds"
    (project / "new").unlink()
    (project / "new").symlink_to("nowhere")
    digest = record.describe_code(diffs)["diff"]
    assert "# not in git: new No such file" in (diffs / f"{digest}.patch").read_text()


def test_packages_are_those_of_the_programs_and_their_reports():
    names = record.packages_of("run", "report")
    assert "libopencv-dev" in names and "python3-pandas" in names and "clang-tidy" not in names
    versions = record.describe_packages()
    assert versions.get("libc6", "2.").startswith("2.")


def test_numbers_that_json_has_not_are_text(tmp_path):
    record.write_json(tmp_path / "a.json", {"a": [float("inf"), 1.5], 2: None})
    assert read(tmp_path, "a.json") == {"a": ["inf", 1.5], "2": None}
    assert [path.name for path in Path(tmp_path).iterdir()] == ["a.json"]
