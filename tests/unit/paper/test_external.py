"""Trajectories of other systems: what is read to the digit, which sequence it is of, and mistakes."""

import sys

import pandas as pd
import pytest

from sgf_paper import config, external
from sgf_paper.external import ExternalError
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.tracking_config import ExternalSystem, load_external_system

FIRST_NS = 1_403_636_579_763_555_584  # of EuRoC's MH_01; no double is equal to it
STEP_NS = 50_000_000
POSE = "1.5 -2 3e-1 0 0.6 0 0.8"


@pytest.fixture
def joined():
    return config.load_experiment("table3")


@pytest.fixture
def write(tmp_path):
    """Writes a file of another system."""

    def write(text, name="slam/MH_01_easy.txt"):
        path = tmp_path / "external" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return write


def test_both_formats_give_the_same_poses_and_times_to_the_nanosecond(write, tmp_path):
    tum = write(f"# time\n\n1403636579.763555584 {POSE} # a pose\n1403636579.8135556 {POSE}\n")
    csv = write(
        "#timestamp, p, q\n"
        f"{FIRST_NS},1.5,-2,3e-1, 0.8,0,0.6,0, 0.1,0,0,\n"
        f"{FIRST_NS + 50_000_016},1.5,-2,3e-1,0.8,0,0.6,0\n",
        "slam/MH_02_easy.csv",
    )
    poses = external.read_poses(tum)
    assert poses == external.read_poses(csv)
    assert [pose.time_ns for pose in poses] == [FIRST_NS, FIRST_NS + 50_000_016]
    out = tmp_path / "out.txt"
    external.write_tum(poses, out)
    assert out.read_text().splitlines()[0] == "1403636579.763555584 1.5 -2.0 0.3 0.0 0.6 0.0 0.8"


@pytest.mark.parametrize(
    "name, line, message",
    [
        ("a.txt", "1 2 3", "has 3 fields, and a pose takes 8$"),
        ("a.txt", f"3 {POSE} 9", "has 9 fields"),
        ("a.txt", f"now {POSE}", "the time 'now' is no number of seconds"),
        ("a.txt", f"nan {POSE}", "the time 'nan' is no number of seconds"),
        ("a.txt", f"inf {POSE}", "the time 'inf' is no number of seconds"),
        ("a.txt", f"1e999999 {POSE}", "the time '1e999999' is no time: 64 bits of nanoseconds do not hold it"),
        ("a.txt", f"1e5000 {POSE}", "the time '1e5000' is no time"),
        ("a.txt", f"-1e5000 {POSE}", "the time '-1e5000' is no time"),
        ("a.csv", "1" * 30 + ",1,2,3,1,0,0,0", "the time '1+' is no time"),
        ("a.txt", "3 1 2 x 0 0 0 1", "'x' is no finite number"),
        ("a.txt", "3 1 2 nan 0 0 0 1", "'nan' is no finite number"),
        ("a.txt", "3 1 2 3 0 0 0 0", "the quaternion's norm is 0"),
        ("a.txt", f"2 {POSE}", "the time 2000000000 ns does not come after"),
        ("a.csv", "3,1,2,3", "has 4 fields, and a pose takes 8 or more"),
        ("a.csv", "3.5,1,2,3,1,0,0,0", "the time '3.5' is no number of whole nanoseconds"),
        ("a.csv", "timestamp,1,2,3,1,0,0,0", "the time 'timestamp' is no number of whole nanoseconds"),
        ("a.csv", "-3,1,2,3,1,0,0,0", "the time -3 ns does not come after"),
    ],
)
def test_mistakes_are_named_with_file_and_line(write, name, line, message):
    first = f"2 {POSE}" if name == "a.txt" else "2,1,2,3,1,0,0,0"
    path = write(f"# poses\n{first}\n{line}\n", f"slam/{name}")
    with pytest.raises(ExternalError, match=f"slam/{name}:3: {message}"):
        external.read_poses(path)


def test_a_file_without_poses_is_a_mistake(write):
    with pytest.raises(ExternalError, match="MH_01_easy.txt: has no poses"):
        external.read_poses(write("# none\n"))


@pytest.mark.parametrize(
    "settings, message",
    [
        ("align: none", "align is 'none'; known: se3, sim3"),
        ("frame: imu", "frame is 'imu'; known: body, camera"),
        ("scale: 2", "unknown key 'scale'"),
    ],
)
def test_how_a_system_is_scored_stands_in_its_folder(write, settings, message):
    folder = write("").parent
    assert load_external_system(folder) == ExternalSystem("body", "se3")
    write("{align: sim3, frame: camera}", "slam/align.yaml")
    assert load_external_system(folder) == ExternalSystem("camera", "sim3")
    write(settings, "slam/align.yaml")
    with pytest.raises(ConfigError, match=f"align.yaml: {message}"):
        load_external_system(folder)


def test_files_are_found_by_system_and_sequence_and_names_are_checked(joined, write, tmp_path):
    paths = [
        write("", name) for name in ("a/MH_01_easy.txt", "b/MH_01_easy.csv", "b/MH_01_easy.txt", "b/x.txt")
    ]
    write("", "b/notes.md")
    found = external.find_files(tmp_path / "external")
    assert found == {("a", "MH_01_easy"): paths[:1], ("b", "MH_01_easy"): paths[1:3], ("b", "x"): paths[3:]}
    external.check_names(joined, paths[0], paths[:1])
    with pytest.raises(ExternalError, match="both MH_01_easy.csv and MH_01_easy.txt"):
        external.check_names(joined, paths[1], paths[1:3])
    with pytest.raises(
        ExternalError, match="x.txt: no sequence is called x; known: MH_01_easy, MH_03_medium"
    ):
        external.check_names(joined, paths[3], paths[3:])
    with pytest.raises(ExternalError, match="vio_ngv is a system of our own"):
        external.check_names(joined, tmp_path / "vio_ngv" / "MH_01_easy.txt", [tmp_path])


def write_images(folder, first_ns, count=3):
    camera = folder / "mav0" / "cam0"
    camera.mkdir(parents=True)
    lines = [f"{first_ns + STEP_NS * i},{i}.png\n" for i in range(count)]
    (camera / "data.csv").write_text("#timestamp [ns],filename\n" + "".join(lines))


@pytest.fixture
def scorer(joined, tmp_path):
    """A rendered sequence, and a cut of the real one of its name; sgf_eval keeps what it is asked."""
    suite, data = tmp_path / "suite", tmp_path / "data"
    write_images(suite / "MH_01_easy", 1_600_000_000 * external.NS)
    write_images(data / "euroc" / "MH_01_easy", FIRST_NS)
    program = tmp_path / "sgf_eval"
    names = ", ".join(f"'{name}': 7" for name in external.KEPT)
    program.write_text(
        f"#!{sys.executable}\nimport json, pathlib, sys\n"
        f"folder = pathlib.Path({str(tmp_path)!r})\n"
        "(folder / 'asked').write_text('\\n'.join(sys.argv[3:-1]))\n"
        "(folder / 'estimate').write_text(pathlib.Path(sys.argv[2]).read_text())\n"
        f"pathlib.Path(sys.argv[-1]).write_text(json.dumps({{{names}}}))\n"
    )
    program.chmod(0o755)
    return external.Scorer(joined, program, suite, str(data))


@pytest.mark.parametrize(
    "seconds, dataset", [("1600000000.05", "synthetic"), ("1403636579.763555", "euroc_slice")]
)
def test_times_tell_which_sequence_a_file_is_of(scorer, write, tmp_path, seconds, dataset):
    path = write(f"1 {POSE}\n{seconds} {POSE}\n1700000000 {POSE}\n")
    line = scorer.score(path)
    assert (line["system"], line["dataset"], line["sequence"]) == ("slam", dataset, "MH_01_easy")
    assert line["ate_mean_m"] == 7
    asked = (tmp_path / "asked").read_text().splitlines()
    root = "suite" if dataset == "synthetic" else "data/euroc"
    assert asked == [
        "--sequence",
        str(tmp_path / root / "MH_01_easy"),
        "--frame",
        "body",
        "--align",
        "se3",
        "--out",
    ]
    assert len((tmp_path / "estimate").read_text().splitlines()) == 1, "only poses of the sequence's time"


def test_a_folder_may_ask_for_another_alignment(scorer, write, tmp_path):
    write("{align: sim3, frame: camera}", "slam/align.yaml")
    scorer.score(write(f"1600000000.05 {POSE}\n"))
    assert (tmp_path / "asked").read_text().split()[2:6] == ["--frame", "camera", "--align", "sim3"]


def test_poses_of_no_sequence_are_a_mistake(scorer, write):
    with pytest.raises(
        ExternalError, match=r"no pose is of the time of MH_01_easy: 1600000000000000000 to .*slice"
    ):
        scorer.score(write(f"5 {POSE}\n"))


def test_sequences_that_are_not_at_hand_are_left_out(joined, scorer):
    assert not external.is_left_out(joined, "MH_01_easy", "")
    assert external.is_left_out(joined, "MH_02_easy", "") and external.is_left_out(
        joined, "MH_02_easy", scorer.data
    )
    assert not external.is_left_out(joined, "x", ""), "a mistake"


def test_the_command_writes_a_line_or_says_what_is_wrong(scorer, write, tmp_path, monkeypatch):
    out = tmp_path / "scores.csv"

    def run(path):
        flags = ["--program", scorer.program, "--suite", scorer.suite, "--data", scorer.data, "--out", out]
        monkeypatch.setattr(sys, "argv", ["external", "table3", str(path), *map(str, flags)])
        external.main()

    run(write(f"1600000000.05 {POSE}\n"))
    assert pd.read_csv(out)["rpe_one_second.translation_m"].tolist() == [7]
    with pytest.raises(SystemExit, match="Error: .*MH_01_easy.txt:1: has 1 fields"):
        run(write("1\n"))
    scorer.program.write_text("#!/bin/sh\nexit 3\n")
    with pytest.raises(SystemExit, match="Error: .*: sgf_eval cannot score it .exit code 3."):
        run(write(f"1600000000.05 {POSE}\n"))
