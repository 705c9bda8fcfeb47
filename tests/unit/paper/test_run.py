"""What a run says of stages that it could not make, and the environment of its jobs."""

from pathlib import Path

from sgf_paper import config, run, summary

NAMES_THE_LOG = "it failed; the run's output names the log"


def test_reasons_say_what_is_of_an_earlier_run_and_stay_until_a_stage_is_run_again(tmp_path):
    settings = run.Settings(Path("bin"), tmp_path, "", Path("generated"), jobs=1, full=False, runs=0)
    tables = tmp_path / "tables"
    tables.mkdir()
    for name in ("table1", "light_change"):
        (tables / f"{name}.csv").touch()
    obstacles = {"table1": "", "table2": "", "table3": "", "light_change": "its data are not at hand"}
    run.write_reasons(settings, obstacles, ["table1", "table2"])
    listing = tmp_path / "stages.tsv"
    expected = {
        "light_change": "its data are not at hand; what is shown is of an earlier run",
        "table1": f"{NAMES_THE_LOG}; what is shown is of an earlier run",
        "table2": NAMES_THE_LOG,
    }
    assert summary.read_reasons(listing) == expected
    run.write_reasons(settings, {"table1": "", "report": ""}, [])
    del expected["table1"]
    assert summary.read_reasons(listing) == expected


def test_a_stage_that_failed_is_not_up_to_date(tmp_path):
    stage = config.load_experiment("sequences")
    assert summary.stage_lines(stage, tmp_path, 0, failed=True) == ["  sequences      NOT MADE"]
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "sequences.csv").touch()
    line = summary.stage_lines(stage, tmp_path, 0, failed=True)[0]
    assert line.startswith("  sequences      FAILED; what is shown is of an earlier run: figures/sequences.png")


def test_jobs_get_settings_of_their_own_unless_the_caller_has_set_them(tmp_path, monkeypatch):
    for name in ("SOURCE_DATE_EPOCH", "GLIBC_TUNABLES"):
        monkeypatch.delenv(name, raising=False)
    ours = run.environment(tmp_path)
    assert ours["SOURCE_DATE_EPOCH"] == "0"
    assert ours["GLIBC_TUNABLES"] == "glibc.malloc.hugetlb=1"
    monkeypatch.setenv("GLIBC_TUNABLES", "glibc.malloc.check=0")
    monkeypatch.setenv("XDG_CACHE_HOME", "/nowhere")
    callers = run.environment(tmp_path)
    assert callers["GLIBC_TUNABLES"] == "glibc.malloc.check=0"
    assert callers["XDG_CACHE_HOME"].startswith(str(tmp_path))
