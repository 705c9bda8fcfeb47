"""tests/fuzz/run, with shell scripts in place of the fuzzers."""
import subprocess
from pathlib import Path

RUN = Path(__file__).with_name("run")
GOOD = """\
echo '#2 INITED cov: 10 ft: 12 corp: 1/1b exec/s: 0 rss: 30Mb'
echo '#9 DONE cov: 34 ft: 56 corp: 1/1b exec/s: 0 rss: 30Mb'
echo 'stat::number_of_executed_units: 789'
"""
CRASH = """\
echo '==7==ERROR: AddressSanitizer: heap-buffer-overflow on address 0x1'
exit 77
"""


def run(tmp_path, script, *arguments):
    programs = tmp_path / "bin"
    programs.mkdir(exist_ok=True)
    for name in ("exr", "image"):
        program = programs / f"fuzz_{name}"
        program.write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/{name}.arguments\n{script}')
        program.chmod(0o755)
    return subprocess.run([RUN, "--programs", programs, "--out", tmp_path / "out", *arguments],
                          capture_output=True, text=True, check=False)


def test_reports_executions_and_coverage(tmp_path):
    ended = run(tmp_path, GOOD, "--seconds", "7", "exr", "image")
    assert ended.returncode == 0, ended.stderr
    assert [line.split() for line in ended.stdout.splitlines()[1:]] == [
        [name, "789", "0", "34", "56", "no", "finding"] for name in ("exr", "image")]


def test_limits_time_and_memory_and_starts_from_the_committed_corpus(tmp_path):
    run(tmp_path, GOOD, "--seconds", "7", "exr")
    arguments = (tmp_path / "exr.arguments").read_text().split()
    assert {"-rss_limit_mb=2048", "-timeout=300", "-max_total_time=7"} <= set(arguments)
    assert arguments[-2:] == [str(tmp_path / "out/corpus/exr"), str(RUN.parent / "corpus/exr")]
    assert not (tmp_path / "image.arguments").exists()


def test_a_crash_is_named_and_fails(tmp_path):
    ended = run(tmp_path, CRASH, "exr")
    assert ended.returncode == 1
    assert "FINDING: ==7==ERROR: AddressSanitizer: heap-buffer-overflow" in ended.stdout


def test_a_fuzzer_that_tried_nothing_fails(tmp_path):
    assert run(tmp_path, "exit 0\n", "exr").returncode == 1


def test_without_names_all_that_are_built_are_run(tmp_path):
    ended = run(tmp_path, GOOD)
    assert ended.returncode == 0
    assert [line.split()[0] for line in ended.stdout.splitlines()[1:]] == ["exr", "image"]
    assert "left out: calibration" in ended.stderr
    (tmp_path / "nothing").mkdir()
    assert run(tmp_path, GOOD, "--programs", tmp_path / "nothing").returncode == 1


def test_an_unknown_name_is_refused(tmp_path):
    ended = run(tmp_path, GOOD, "moon")
    assert ended.returncode == 2
    assert "no fuzzer moon" in ended.stderr


def test_every_fuzzer_has_a_corpus():
    fuzzers = {path.name.rpartition("_fuzzer.")[0] for path in RUN.parent.glob("*_fuzzer.*")}
    assert fuzzers == {folder.name for folder in (RUN.parent / "corpus").iterdir() if any(folder.iterdir())}
