"""reproduce.sh: options, packages, build and the test command."""

import fcntl
import re
import shutil

import pytest

from conftest import HERE, PROJECT

EXPERIMENTS = sorted(path.stem for path in (PROJECT / "paper" / "experiments").glob("*.yaml"))
PROGRAMS = "sgf_align sgf_direct sgf_eval sgf_render sgf_stereo sgf_study sgf_vio stereo_bench"
MRPT_PROGRAMS = "dataset2rawlog sgf-odometry-cli"
APT_LINE = "sudo apt-get update && sudo apt-get install -y --no-install-recommends "


def sections():
    """packages.apt read independently of reproduce.sh."""
    found, section = {}, None
    for line in (PROJECT / "packages.apt").read_text().splitlines():
        line = line.split("#")[0].strip()
        if match := re.fullmatch(r"\[(\w+)\]", line):
            section = found.setdefault(match[1], [])
        elif line:
            section.append(line)
    return found


def test_the_sections_name_each_package_once():
    found = sections()
    assert list(found) == ["run", "report", "test", "sanitize", "dev"]
    every = [package for packages in found.values() for package in packages]
    assert len(every) == len(set(every))
    assert all(re.fullmatch(r"[a-z0-9][a-z0-9+.-]+", package) for package in every)


def test_help_and_list_need_nothing_built(project):
    code, output = project.run("--help")
    assert code == 0 and "--only NAME" in output and "./reproduce.sh test" in output
    assert "--full  " in output
    code, output = project.run("--list")
    assert code == 0
    assert [line.split()[0] for line in output.splitlines()] == EXPERIMENTS
    assert all(len(line.split()) > 2 for line in output.splitlines())
    assert project.stub_log() == "" and not project.results.exists()


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["--fast"], "unknown option '--fast'"),
        (["tests"], "unknown option 'tests'"),
        (["--only"], "--only needs"),
        (["--only", "--list"], "--only needs"),
        (["--only", "table1", "--only"], "--only needs"),
        (["--only", "table1", "table8"], "unknown experiment 'table8'; known: bench_stereo"),
        (["--only", "../experiments/table1"], "unknown experiment"),
        (["--jobs", "0"], "--jobs needs a positive number, not '0'"),
        (["--jobs", "two"], "--jobs needs a positive number, not 'two'"),
        (["--jobs"], "--jobs needs"),
        (["--runs", "0"], "--runs needs a positive number, not '0'"),
        (["--runs"], "--runs needs"),
        (["--cluster"], "--cluster needs the kind of cluster: slurm"),
        (["--cluster", "sge"], "--cluster needs the kind of cluster: slurm"),
        (["--data"], "--data needs a folder"),
        (["--data", ""], "--data needs a folder"),
        (["--data", "/nonexistent/data"], "data folder '/nonexistent/data' does not exist"),
        (["--accept-licences"], "--accept-licences goes with --full only"),
        (["--sanitize"], "--sanitize does not go with a run of experiments"),
        (["test", "--only", "table1"], "--only does not go with test"),
        (["test", "--full", "--accept-licences"], "--full does not go with test"),
        (["--runs", "3", "test"], "--runs does not go with test"),
        (["test", "--cluster", "slurm"], "--cluster does not go with test"),
        (["--verify", "--only", "table1"], "--only does not go with --verify"),
        (["--verify", "--cluster", "slurm"], "--cluster does not go with --verify"),
        (["--verify", "--data", "/"], "--data does not go with --verify"),
        (["--clean", "--only", "table1"], "--only does not go with --clean"),
        (["--clean", "--sanitize"], "--sanitize does not go with --clean"),
        (["--list", "--jobs", "3"], "--jobs does not go with --list"),
        (["--list", "--full"], "--full does not go with --list"),
        (["test", "--clean"], "--clean does not go with test"),
        (["--list", "--clean"], "--clean does not go with --list"),
        (["--clean", "--verify"], "--verify does not go with --clean"),
    ],
)
def test_wrong_usage_ends_with_2_before_anything_is_done(project, arguments, message):
    code, output = project.run(*arguments)
    assert code == 2
    assert message in output
    assert project.stub_log() == "" and not project.results.exists()


@pytest.fixture
def programs(project):
    """A folder for programs, to stand first on the PATH."""
    (project.root / "programs").mkdir()
    return project.root / "programs"


def write_program(file, text):
    file.write_text(f"#!/bin/bash\n{text}\n")
    file.chmod(0o755)


def test_a_cluster_is_missed_before_anything_is_done(project, programs):
    for name in ("bash", "dirname"):
        (programs / name).symlink_to(shutil.which(name))
    code, output = project.run("--cluster", "slurm", PATH=str(programs))
    assert (code, output) == (1, "Error: sbatch is not installed: is this a machine of the cluster?\n")


@pytest.mark.parametrize("flags, processes", [(["--cluster", "slurm"], 3), ([], 200)])
def test_jobs_of_a_cluster_are_not_those_of_the_build(project, programs, flags, processes):
    for name, text in (("sbatch", "exit 1"), ("nproc", "echo 3")):
        write_program(programs / name, text)
    (project.root / "fail_build").touch()
    project.run("--jobs", "200", *flags, PATH=f"{programs}:{HERE / 'stubs'}:/usr/bin:/bin")
    assert f"--parallel {processes} " in project.stub_log()


FETCH = """#!/usr/bin/python3
import pathlib, sys
pathlib.Path(__file__).with_name("fetched").write_text(" ".join(sys.argv[1:]))
sys.exit("Error: no network")
"""


def test_full_without_accepted_licences_says_so_and_goes_on(project):
    code, output = project.run("--full", "--only", "fig1")
    assert code == 0, output
    assert "icl_nuim_lr_kt2        NOT FETCHED: accept its licence, above, with --accept-licences" in output
    assert "licence: CC BY 3.0" in output and "middlebury" not in output[: output.index("== build")]
    assert f"going on with the data sets at hand; log: {project.results}/logs/fetch.log" in output
    assert "fig1           made" in output
    assert list((project.root / "datasets" / "downloaded").iterdir()) == []


@pytest.mark.parametrize("own", [True, False])
def test_full_fetches_what_the_experiments_use_and_goes_on_without_a_network(project, own):
    (project.root / "datasets" / "fetch").write_text(FETCH)
    project.data.mkdir()
    data = project.data if own else project.root / "datasets" / "downloaded"
    flags = ["--data", project.data] if own else []
    code, output = project.run("--full", "--accept-licences", "--only", "scenes", "table1", *flags)
    assert code == 0 and "Error: no network" in output and "scenes         made" in output, output
    called = (project.root / "datasets" / "fetched").read_text()
    assert called == f"--for scenes table1 --into {data} --accept-licences"


def test_a_run_that_is_not_full_and_tests_fetch_nothing(project):
    (project.root / "datasets" / "fetch").write_text(FETCH)
    assert project.run("--only", "scenes")[0] == 0
    assert project.run("test")[0] == 0
    assert not (project.root / "datasets" / "fetched").exists()


def test_a_data_folder_from_the_environment_must_exist(project):
    code, output = project.run("--list", SGF_DATA="/nonexistent/data")
    assert code == 2 and "'/nonexistent/data' does not exist" in output


def test_without_root_and_sudo_the_apt_line_is_printed(project):
    missing = "snakemake python3-pandas"
    code, output = project.run(STUB_MISSING=missing, STUB_UID="1000", STUB_NO_SUDO="1")
    assert code == 1
    assert f"{APT_LINE}{missing}\n" in output
    assert "docker build" in output and "docker run" in output
    assert "apt-get" not in project.stub_log() and "cmake" not in project.stub_log()


def test_packages_of_the_tests_are_not_asked_for_by_a_plain_run(project):
    code, output = project.run("--only", "table1", STUB_MISSING="libgtest-dev", STUB_UID="1000")
    assert code == 0 and "apt-get" not in project.stub_log()
    code, output = project.run("test", STUB_MISSING="libgtest-dev", STUB_UID="1000", STUB_NO_SUDO="1")
    assert code == 1 and f"{APT_LINE}libgtest-dev\n" in output


@pytest.mark.parametrize("uid, prefix", [("0", ""), ("1000", "sudo -n env ")])
def test_missing_packages_are_installed_without_questions(project, uid, prefix):
    code, output = project.run("--only", "table1", STUB_MISSING="g++ cmake", STUB_UID=uid)
    assert code == 0
    assert "installing 2: g++ cmake" in output
    log = project.stub_log()
    assert re.search(r"apt-get -y .* update DEBIAN_FRONTEND=noninteractive", log)
    assert re.search(r"apt-get -y .* install --no-install-recommends g\+\+ cmake DEBIAN_FRONT", log)
    assert prefix in log and ("sudo" in log) == bool(prefix)


def test_nothing_made_is_said_before_python_is_asked(project):
    line = f"Error: no finished run in {project.results}; run ./reproduce.sh first\n"
    assert project.run("--verify", STUB_MISSING="python3-yaml") == (1, line)
    assert not project.results.exists()


def test_what_was_made_elsewhere_is_verified_with_the_packages_of_a_run(project):
    run = project.results / "raw" / "fig2" / "run.json"
    run.parent.mkdir(parents=True)
    run.touch()
    code, output = project.run("--verify", STUB_MISSING="python3-yaml", STUB_UID="1000", STUB_NO_SUDO="1")
    assert code == 1 and f"{APT_LINE}python3-yaml\n" in output


def test_a_failing_apt_names_its_log(project):
    code, output = project.run(STUB_MISSING="g++", STUB_APT_FAILS="1")
    log = project.results / "logs" / "packages.log"
    assert code == 1
    assert f"apt-get update failed; log: {log}" in output
    assert "E: no network" in log.read_text()


def test_a_failing_build_shows_the_error_and_names_its_log(project):
    (project.root / "fail_build").touch()
    code, output = project.run("--only", "table1")
    assert code == 1
    assert "x.cc:1: error: told to fail" in output
    assert f"building failed; log: {project.results / 'logs' / 'build.log'}" in output


def test_the_test_command_builds_all_and_ends_with_ctests_summary(project):
    project.data.mkdir()
    code, output = project.run("test", "--data", "my data", "--jobs", "3")
    assert code == 2, "a relative folder is the caller's, and the caller is elsewhere"
    code, output = project.run("test", "--data", str(project.data), "--jobs", "3")
    assert code == 0
    log = project.stub_log()
    assert "cmake --preset release -DSGF_BUILD_TESTS=ON" in log
    assert "--target" not in log
    assert f"ctest --preset release --parallel 3 SGF_DATA={project.data}" in log
    assert output.splitlines()[-1] == "100% tests passed, 0 tests failed out of 3"


def test_the_sanitizers_have_a_build_of_their_own(project):
    code, output = project.run("test", "--sanitize", "--jobs", "3")
    assert code == 0 and f"built in {project.root}/build/sanitize" in output
    log = project.stub_log()
    assert "cmake --preset sanitize" in log and "cmake --build --preset sanitize" in log
    assert "ctest --preset sanitize --parallel 3" in log
    assert "preset release" not in log and "--target" not in log
    assert "== packages [run] [report] [test] [sanitize]\n" in output


def test_a_run_builds_only_the_programs_and_keeps_a_developers_tests(project):
    project.run("--only", "table1")
    assert "-DSGF_BUILD_TESTS=OFF" in project.stub_log()
    assert re.search(rf"--target {PROGRAMS} {MRPT_PROGRAMS}$", project.stub_log(), re.MULTILINE)
    project.run("test")
    project.log.unlink()
    project.run("--only", "table1")
    assert "-DSGF_BUILD_TESTS=ON" in project.stub_log()


def test_without_mrpt_its_programs_are_not_asked_for_and_that_is_said(project):
    code, output = project.run("--only", "scenes", "mrpt_map", STUB_NO_MRPT="1")
    assert code == 0, output
    assert re.search(rf"--target {PROGRAMS}$", project.stub_log(), re.MULTILINE)
    log = project.results / "logs" / "configure.log"
    assert f"the MRPT module and what it shows are left out; why: {log}" in output and log.exists()
    assert "mrpt_map       left out: the MRPT module is not part of the build" in output
    assert "scenes         made" in output
    code, output = project.run("--only", "mrpt_map", STUB_NO_MRPT="1")
    assert code == 1 and "(mrpt_map: the MRPT module is not part of the build)" in output


def test_clean_keeps_the_reference_and_the_sources(project):
    reference = project.results / "reference" / "table1.csv"
    reference.parent.mkdir(parents=True)
    reference.touch()
    assert project.run("--only", "table1")[0] == 0
    assert (project.results / "tables" / "table1.csv").exists()
    assert project.run("--clean")[0] == 0
    assert [path.name for path in project.results.iterdir()] == ["reference"]
    assert reference.exists()
    assert not project.bin.exists() and not (project.root / "datasets" / "generated").exists()
    assert (project.root / "datasets" / "debian_pairs.py").exists()


def test_clean_leaves_alone_what_a_run_is_making(project):
    lock = project.results / ".lock"
    lock.parent.mkdir()
    project.bin.mkdir(parents=True)
    with lock.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        code, output = project.run("--clean")
        assert (code, output) == (1, f"Error: a run is at work in {project.results}; nothing was removed\n")
        assert lock.exists() and project.bin.exists()
    assert project.run("--clean")[0] == 0
    assert not lock.exists() and not project.bin.exists()


def test_clean_says_what_it_could_not_remove(project, programs):
    (project.results / "tables").mkdir(parents=True)
    refusal = "rm: cannot remove 'results/tables/table1.csv': Permission denied"
    write_program(programs / "rm", f"""[[ $* != *results/tables* ]] || {{ echo "{refusal}" >&2; exit 1; }}""")
    code, output = project.run("--clean", PATH=f"{programs}:/usr/bin:/bin")
    assert (code, output) == (1, f"Error: not everything could be removed: {refusal}\n")
