"""What the module's programs write, in MRPT's own applications, without a display."""

import os
import re
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import room

HERE = Path(__file__).resolve().parent
MODULE = HERE.parent
BUILD = Path(os.environ["SGF_BUILD_DIR"])
PLUGIN = BUILD / "lib" / "libmrpt-sgf-odometry-sensor.so"
DATA = os.environ.get("SGF_DATA")
FRAMES = {"room": 40, "mh01": 60, "inertial": 60}
ENVIRONMENT = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}


def run(*command, **options):
    return subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=240, env=ENVIRONMENT, **options
    )


def tool(name, *arguments, **options):
    result = run(BUILD / "bin" / name, *arguments, **options)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def fails(name, *arguments, parts):
    """Bad input: exit code 2 and one line on stderr that has all the parts."""
    result = run(BUILD / "bin" / name, *arguments)
    assert result.returncode == 2, result.stdout + result.stderr
    (error,) = result.stderr.strip().splitlines()
    assert all(str(part) in error for part in parts), error


def read_tum(file):
    """Time, position, quaternion (x y z w) of each pose."""
    return np.loadtxt(file, ndmin=2)


def edited_ini(name, target, **values):
    """A sample configuration with some values replaced."""
    text = (MODULE / "config" / name).read_text()
    for key, value in values.items():
        text, count = re.subn(rf"(?m)^(\s*{key}\s*=\s*)[^#\n]*", rf"\g<1>{value} ", text)
        assert count > 0, key
    target.write_text(text)
    return target


class Drive:
    """A rawlog and what the odometry made of it."""

    def __init__(self, dataset, folder, frames, estimator="stereo"):
        self.frames = frames
        self.estimator = estimator
        self.folder = folder
        self.dataset = dataset
        self.rawlog = folder / "in.rawlog"
        tool("dataset2rawlog", "-i", dataset, "-o", self.rawlog, "-n", frames)
        self.prefix = folder / "out"
        config = edited_ini("sgf-odometry.ini", folder / "odometry.ini", estimator=estimator)
        self.report = tool("sgf-odometry-cli", "-i", self.rawlog, "-o", self.prefix, "-c", config)
        self.poses = read_tum(f"{self.prefix}.tum")

    def file(self, ending):
        return Path(f"{self.prefix}{ending}")


@pytest.fixture(scope="module", params=list(FRAMES))
def drive(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    frames = FRAMES[request.param]
    if request.param == "room":
        return Drive(room.write_euroc(folder / "room", room.curve(frames)), folder, frames)
    if request.param == "inertial":
        dataset = room.write_euroc(folder / "room", room.slalom(frames))
        return Drive(dataset, folder, frames, "stereo_inertial")
    dataset = Path(DATA or "") / "euroc" / "MH_01_easy"
    if not DATA or not dataset.is_dir():
        pytest.skip("SGF_DATA has no euroc/MH_01_easy")
    return Drive(dataset, folder, frames)


# --- the odometry itself ---------------------------------------------------------------------------


def test_every_frame_has_a_pose_and_every_file_is_there(drive):
    assert len(drive.poses) == drive.frames
    assert f"frames: {drive.frames}, with pose: {drive.frames}, lost: 0" in drive.report
    assert "skipped" not in drive.report
    for ending in ("_obs.rawlog", "_actsf.rawlog", ".simplemap", ".3Dscene", ".ply", ".png", ".tum"):
        assert drive.file(ending).stat().st_size > 0
    assert max(Image.open(drive.file(".png")).size) == 1001
    assert not list(drive.folder.glob("*.part"))


def test_the_room_is_driven_through_as_it_was(tmp_path):
    path = room.curve(30)
    tool("sgf-odometry-cli", "-i", room.write_euroc(tmp_path / "room", path), "-o", tmp_path / "out")
    poses = read_tum(tmp_path / "out.tum")
    assert np.abs(poses[:, 0] - room.times_ns(30) * 1e-9).max() < 1e-6
    assert np.abs(poses[:, 1:3] - path[:, :2]).max() < 0.01
    assert np.abs(poses[:, 3]).max() < 0.01
    assert np.abs(2 * np.arctan2(poses[:, 6], poses[:, 7]) - path[:, 2]).max() < np.radians(0.3)


def test_the_stereo_inertial_odometry_follows_a_lively_drive(tmp_path):
    path = room.slalom(60)
    dataset = room.write_euroc(tmp_path / "room", path)
    config = edited_ini("sgf-odometry.ini", tmp_path / "in.ini", estimator="stereo_inertial")
    report = tool("sgf-odometry-cli", "-i", dataset, "-o", tmp_path / "out", "-c", config)
    assert "inertial sensor: takes part" in report and "frames without: 0" in report
    poses = read_tum(tmp_path / "out.tum")
    assert len(poses) == 60
    assert np.abs(poses[:, 1:4] - np.c_[path[:, :2], np.zeros(60)]).max() < 0.03
    yaw = 2 * np.arctan2(poses[:, 6], poses[:, 7])
    assert np.abs(yaw - path[:, 2]).max() < np.radians(0.5)
    # A rawlog has all that is needed, and one without measurements says so.
    tool("dataset2rawlog", "-i", dataset, "-o", tmp_path / "in.rawlog")
    tool("sgf-odometry-cli", "-i", tmp_path / "in.rawlog", "-o", tmp_path / "again", "-c", config)
    assert (tmp_path / "again.tum").read_text() == (tmp_path / "out.tum").read_text()
    tool("dataset2rawlog", "-i", dataset, "-o", tmp_path / "in.rawlog", "--no-imu")
    report = tool("sgf-odometry-cli", "-i", tmp_path / "in.rawlog", "-o", tmp_path / "alone", "-c", config)
    assert "with pose: 60" in report
    assert "takes no part, there are no inertial observations" in report


# --- MRPT's applications ---------------------------------------------------------------------------


def rawlog_info(file):
    """What rawlog-edit, which knows nothing of our library, says of a rawlog."""
    result = run("rawlog-edit", "--info", "-i", file.name, cwd=file.parent)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def exported_poses(rawlog, label):
    """Rows of rawlog-edit's export of a sensor: time, x, y, z, yaw, pitch, roll, covariances."""
    result = run("rawlog-edit", "--export-txt", "-i", rawlog.name, cwd=rawlog.parent)
    assert result.returncode == 0, result.stdout + result.stderr
    return np.loadtxt(rawlog.with_name(f"{rawlog.stem}_{label}.txt"), comments="%", ndmin=2)


def same_poses(rows, tum):
    assert len(rows) == len(tum)
    assert np.abs(rows[:, 0] - tum[:, 0]).max() < 1e-5
    assert np.abs(rows[:, 1:4] - tum[:, 1:4]).max() < 2e-5
    half_yaw = np.arctan2(tum[:, 6], tum[:, 7])  # exact without pitch and roll
    assert np.abs(rows[:, 4] - 2 * half_yaw).max() < 0.05
    return True


def test_rawlogs_are_read_to_their_last_object_without_our_library(drive):
    assert "sgf" not in run("ldd", shutil.which("rawlog-edit")).stdout
    observations = rawlog_info(drive.file("_obs.rawlog"))
    assert re.search(rf"number of objects +: {2 * drive.frames + 1}\n", observations)
    assert re.search(rf"SGF_ODOMETRY / +{drive.frames} /", observations)
    actions = rawlog_info(drive.file("_actsf.rawlog"))
    assert re.search(rf"number of objects +: {2 * (drive.frames - 1)}\n", actions)
    assert re.search("Actions/SensoryFrame format +: Yes", actions)
    assert same_poses(exported_poses(drive.file("_obs.rawlog"), "SGF_ODOMETRY"), drive.poses)
    images = rawlog_info(drive.rawlog)
    assert re.search(rf"CAMERA / +{drive.frames} /", images)
    assert "Found external storage directory: in_Images" in images


def grab(config, *flags, until=1):
    """Output of rawlog-grabber, which runs until its standard input ends: once it has saved enough."""
    log = config.with_suffix(".log")
    with open(log, "w") as out:
        process = subprocess.Popen(
            ["stdbuf", "-oL", "rawlog-grabber", *map(str, flags), str(config)],
            stdin=subprocess.PIPE, stdout=out, stderr=subprocess.STDOUT, env=ENVIRONMENT,
        )
        for _ in range(400):
            saved = sum(map(int, re.findall(r"Saved (\d+) objects", log.read_text())))
            if saved >= until or "Exception in SensorThread" in log.read_text():
                break
            time.sleep(0.2)
        process.stdin.close()
        process.wait(timeout=60)
    return log.read_text()


def test_rawlog_grabber_writes_our_poses_and_needs_the_plug_in_for_it(drive, tmp_path):
    config = edited_ini(
        "rawlog-grabber.ini", tmp_path / "grab.ini",
        path=drive.rawlog, rawlog_prefix=tmp_path / "grabbed", estimator=drive.estimator,
    )
    grab(config, "-p", PLUGIN, until=2 * drive.frames + 1)
    (rawlog,) = tmp_path.glob("grabbed*.rawlog")
    assert same_poses(exported_poses(rawlog, "SGF"), drive.poses)
    assert re.search(rf"number of objects +: {2 * drive.frames + 1}\n", rawlog_info(rawlog))
    assert "Class name not recognized: CSgfOdometrySensor" in grab(config)


def test_rawlog_grabber_names_an_unknown_key(tmp_path):
    config = edited_ini("rawlog-grabber.ini", tmp_path / "grab.ini", rawlog_prefix=tmp_path / "out")
    config.write_text(config.read_text().replace("max_gap_s", "max_gap"))
    assert "section SGF: unknown key 'max_gap'" in grab(config, "-p", PLUGIN)


def test_rbpf_slam_ends_its_odometry_path_at_our_pose(drive, tmp_path):
    config = edited_ini("rbpf-slam.ini", tmp_path / "rbpf.ini", logOutput_dir=tmp_path / "out")
    result = run("rbpf-slam", config, drive.file("_actsf.rawlog"), stdin=subprocess.DEVNULL)
    assert result.returncode == 0, result.stdout + result.stderr
    path = np.loadtxt(tmp_path / "out" / "log_odometry_path.txt", comments="%")
    assert len(path) == drive.frames - 1
    assert np.abs(path[-1, 1:4] - drive.poses[-1, 1:4]).max() < 1e-3


def read_graph(file):
    """Vertices, and edges as (from, to, mean, information) in x, y, z, yaw, pitch, roll."""
    vertices, edges = {}, []
    for line in file.read_text().splitlines():
        kind, *fields = line.split()
        if kind == "VERTEX3":
            vertices[int(fields[0])] = np.array(fields[1:7], float)
        elif kind == "EDGE3":
            information = np.zeros((6, 6))
            information[np.triu_indices(6)] = np.array(fields[8:29], float)
            information += np.triu(information, 1).T
            order = [0, 1, 2, 5, 4, 3]  # MRPT writes roll, pitch, yaw
            mean = np.array(fields[2:8], float)[order]
            edges.append((int(fields[0]), int(fields[1]), mean, information[np.ix_(order, order)]))
    return vertices, edges


def stock_graph(actions, folder):
    """The graph that graphslam-engine makes of a rawlog of actions, a node an action."""
    folder.mkdir()
    config = edited_ini("graphslam-engine.ini", folder / "engine.ini")
    flags = ["-n", "CFixedIntervalsNRD", "-e", "CEmptyERD", "-o", "CLevMarqGSO", "--disable-visuals"]
    result = run("graphslam-engine", "--3d", *flags, "-i", config, "-r", actions,
                 cwd=folder, stdin=subprocess.DEVNULL)
    assert result.returncode == 0, result.stdout + result.stderr
    return read_graph(folder / "graphslam_results" / "output_graph.graph")


def matrix_of(pose):
    """Homogeneous matrix of x, y, z, yaw, pitch, roll."""
    (sy, sp, sr), (cy, cp, cr) = np.sin(pose[3:]), np.cos(pose[3:])
    T = np.eye(4)
    T[:3, :3] = (
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )
    T[:3, 3] = pose[:3]
    return T


def pose_of(T):
    R = T[:3, :3]
    yaw, roll = np.arctan2(R[1, 0], R[0, 0]), np.arctan2(R[2, 1], R[2, 2])
    return np.array([*T[:3, 3], yaw, np.arcsin(-R[2, 0]), roll])


def covariance_in_stock_graph(increment, covariance):
    """CFixedIntervalsNRD starts each edge from the identity with 1e-4 I, and composes with ours."""
    step = 1e-6
    end = matrix_of(increment)
    columns = [
        (pose_of(matrix_of(d) @ end) - pose_of(matrix_of(-d) @ end)) / (2 * step)
        for d in step * np.eye(6)
    ]
    J = np.stack(columns, 1)
    return 1e-4 * J @ J.T + covariance


def half_unit(values):
    """Of the last of the six digits of MRPT's graph files."""
    return 0.5 * 10 ** (np.floor(np.log10(np.abs(values) + 1e-300)) - 5)


def covariance_rounding(information):
    """Bound of what these digits leave open in the inverse."""
    covariance = np.abs(np.linalg.inv(information))
    return 1.1 * covariance @ half_unit(information) @ covariance  # a tenth for higher orders


def test_graphslam_engine_has_our_vertices_and_our_covariance(drive, tmp_path):
    vertices, edges = stock_graph(drive.file("_actsf.rawlog"), tmp_path / "stock")
    assert len(vertices) == drive.frames and len(edges) == drive.frames - 1
    config = edited_ini(
        "sgf-graphslam.ini", tmp_path / "ours.ini",
        registration_max_distance=-1, registration_max_angle=-1, estimator=drive.estimator,
    )
    tool("sgf-graphslam", "-c", config, "-i", drive.rawlog, "-o", tmp_path / "ours", "--no-loop-closing")
    _, ours = read_graph(tmp_path / "ours.graph")
    assert len(ours) == len(edges)
    shown = []
    for (_, _, mean, information), (_, _, increment, our_information) in zip(edges, ours):
        assert np.abs(mean - increment).max() < 1e-5
        covariance = np.linalg.inv(our_information)
        expected = covariance_in_stock_graph(increment, covariance)
        rounding = covariance_rounding(information) + covariance_rounding(our_information)
        rounding += 2e-4 * half_unit(increment).max()  # of the Jacobian, to both sides of 1e-4
        assert (np.abs(np.linalg.inv(information) - expected) < rounding).all()
        shown.append(np.abs(covariance).max() / rounding.max())
    assert max(shown) > 20  # else this would not show anything


def test_observations2map_rebuilds_the_map(drive, tmp_path):
    config = MODULE / "config" / "observations2map.ini"
    result = run("observations2map", config, drive.file(".simplemap"), tmp_path / "map", "-s", "Map",
                 stdin=subprocess.DEVNULL)
    assert result.returncode == 0, result.stdout + result.stderr
    (tree,) = tmp_path.glob("map*.bt")
    (scene,) = tmp_path.glob("map*.3Dscene")
    assert tree.stat().st_size > 1000 and scene.stat().st_size > 1000
    (points,) = (np.loadtxt(f) for f in tmp_path.glob("map*PointsMap*.txt"))
    assert len(points) > 50
    if drive.folder.name.startswith("room"):
        # In the map frame the walls are where the room has them.
        gaps = np.abs(np.abs(points) - room.HALF).min(axis=1)
        assert np.median(gaps) < 0.05


# --- loop closing ----------------------------------------------------------------------------------


def end_error(file, path):
    """Distance of the last node from where the robot was."""
    *_, last = read_tum(file)
    frame = round((last[0] * 1e9 - room.START_NS) / room.PERIOD_NS)
    return np.linalg.norm(last[1:4] - [*path[frame, :2], 0])


@pytest.mark.parametrize("estimator", ["stereo", "stereo_inertial"])
def test_closed_loops_bring_the_end_back_to_the_start(estimator, tmp_path):
    path = room.circle(160)[:-2]  # not quite the same view again
    dataset = room.write_euroc(tmp_path / "loop", path)
    config = edited_ini("sgf-graphslam.ini", tmp_path / "loop.ini", estimator=estimator)
    output = tool("sgf-graphslam", "-c", config, "-i", dataset, "-o", tmp_path / "closed")
    assert int(re.search(r"(\d+) loop closures", output)[1]) >= 1
    output = tool("sgf-graphslam", "-c", config, "-i", dataset, "-o", tmp_path / "open", "--no-loop-closing")
    assert "0 loop closures" in output
    closed, opened = (end_error(tmp_path / f"{name}.tum", path) for name in ("closed", "open"))
    print(f"end-to-start error: {closed:.4f} m closed, {opened:.4f} m open")
    assert closed <= opened / 3


# --- data sets and bad input -----------------------------------------------------------------------


@pytest.mark.parametrize("write", [room.write_kitti, room.write_euroc])
def test_stereo_layouts_become_rawlogs(write, tmp_path):
    dataset = write(tmp_path / "data", room.curve(6))
    (tmp_path / "logs").mkdir()
    for flags, name in (([], "external"), (["--embed"], "embedded")):
        rawlog = tmp_path / "logs" / f"{name}.rawlog"
        assert "6 frames" in tool("dataset2rawlog", "-i", dataset, "-o", rawlog, *flags)
    shutil.rmtree(tmp_path / "data")  # rawlogs are complete in themselves
    assert len(list((tmp_path / "logs" / "external_Images").iterdir())) == 12
    assert not (tmp_path / "logs" / "embedded_Images").exists()
    poses = []
    for name in ("external", "embedded"):
        tool("sgf-odometry-cli", "-i", tmp_path / "logs" / f"{name}.rawlog", "-o", tmp_path / name)
        poses.append((tmp_path / f"{name}.tum").read_text())
    assert poses[0] == poses[1] and len(poses[0].splitlines()) == 7


def test_depth_layouts_become_rawlogs(tmp_path):
    dataset = room.write_tum(tmp_path / "data", room.curve(4))
    (tmp_path / "logs").mkdir()
    rawlog = tmp_path / "logs" / "in.rawlog"
    for image in (dataset / "rgb").iterdir():  # at the size that TUM's intrinsics are for
        Image.open(image).resize((640, 480), Image.BILINEAR).save(image)
    for image in (dataset / "depth").iterdir():
        Image.open(image).resize((640, 480), Image.NEAREST).save(image)
    assert "4 frames, 0 inertial" in tool("dataset2rawlog", "-i", dataset, "-o", rawlog)
    shutil.rmtree(dataset)
    tool("sgf-odometry-cli", "-i", rawlog, "-o", tmp_path / "out")
    assert len(read_tum(tmp_path / "out.tum")) == 4
    assert re.search(r"CAMERA / +4 /", rawlog_info(rawlog))


def test_missing_images_are_skipped_and_counted(tmp_path):
    dataset = room.write_euroc(tmp_path / "room", room.curve(5))
    rawlog = tmp_path / "in.rawlog"
    tool("dataset2rawlog", "-i", dataset, "-o", rawlog)
    (tmp_path / "in_Images" / "000002_right.png").unlink()
    report = tool("sgf-odometry-cli", "-i", rawlog, "-o", tmp_path / "out")
    assert "frames: 4, with pose: 4" in report
    assert "skipped: 1 x external image that cannot be loaded" in report
    shutil.rmtree(tmp_path / "in_Images")
    fails("sgf-odometry-cli", "-i", rawlog, "-o", tmp_path / "none", parts=[rawlog, "no frame"])
    assert not list(tmp_path.glob("none*"))


def test_frames_with_a_missing_file_are_left_out_and_counted(tmp_path):
    dataset = room.write_euroc(tmp_path / "room", room.curve(4))
    sorted((dataset / "mav0" / "cam1" / "data").iterdir())[1].unlink()
    rawlog = tmp_path / "in.rawlog"
    said = "left out: 1 x frame with a missing file"
    assert said in tool("dataset2rawlog", "-i", dataset, "-o", rawlog)
    assert said in tool("sgf-odometry-cli", "-i", dataset, "-o", tmp_path / "out")
    assert "left out" not in tool("sgf-odometry-cli", "-i", rawlog, "-o", tmp_path / "out")


def test_bad_input_is_named(tmp_path):
    missing = tmp_path / "missing.rawlog"
    out = tmp_path / "out"
    fails("sgf-odometry-cli", "-i", missing, "-o", out, parts=[missing])
    noise = tmp_path / "noise.rawlog"
    noise.write_bytes(b"no rawlog at all")
    fails("sgf-odometry-cli", "-i", noise, "-o", out, parts=[noise])
    fails("dataset2rawlog", "-i", tmp_path, "-o", out, parts=[tmp_path])
    nowhere = tmp_path / "no" / "out.rawlog"
    dataset = room.write_euroc(tmp_path / "room", room.curve(2))
    fails("dataset2rawlog", "-i", dataset, "-o", nowhere, parts=[nowhere, "cannot be written"])
    assert not nowhere.parent.exists()
    fails("dataset2rawlog", "-i", tmp_path, "-o", out, "-l", "kiti", parts=["kiti", "kitti"])
    assert not list(tmp_path.glob("out*"))


def test_layouts_are_called_by_the_names_that_are_known(tmp_path):
    known = run(BUILD / "bin" / "dataset2rawlog", "-i", tmp_path, "-o", tmp_path / "x", "-l", "kiti").stderr
    names = set(re.search("known: (.*)", known)[1].split(", ")) - {"tum_mono"}  # which has no depth
    told = (
        tool("dataset2rawlog", "--help"),
        (MODULE / "share" / "man" / "man1" / "dataset2rawlog.1").read_text(),
        (MODULE / "include" / "mrpt" / "sgf" / "CObservationSource.h").read_text(),
    )
    for text in told:
        assert set(re.findall(r"\b(?:euroc|kitti|tum|icl)(?:_[a-z]+)?\b", text)) == names


def test_what_the_sample_configuration_proposes_is_accepted(tmp_path):
    dataset = room.write_euroc(tmp_path / "room", room.curve(2))
    sample = (MODULE / "config" / "sgf-odometry.ini").read_text()
    proposed = dict(re.findall(r"(?m)^# ([\w.]+) += (\w+)$", sample))
    assert proposed == {"flow.residual": "ngv", "flow.image.epsilon.scope": "window"}
    config = tmp_path / "proposed.ini"
    config.write_text(re.sub("(?m)^flow.residual.*", "", sample).replace("# flow.", "flow."))
    tool("sgf-odometry-cli", "-i", dataset, "-o", tmp_path / "out", "-c", config)
    config.write_text(config.read_text().replace("= window", "= windows"))
    fails("sgf-odometry-cli", "-i", dataset, "-o", tmp_path / "out", "-c", config, parts=["'windows'"])


def test_bad_configurations_are_named(tmp_path):
    dataset = room.write_euroc(tmp_path / "room", room.curve(2))
    config = edited_ini("sgf-odometry.ini", tmp_path / "bad.ini", use_imu="maybe")
    arguments = ["-i", dataset, "-o", tmp_path / "out", "-c", config]
    fails("sgf-odometry-cli", *arguments, parts=["SgfOdometry", "maybe"])
    fails("sgf-odometry-cli", *arguments, "-s", "Other", parts=["Other"])
    for line, part in {
        "use_imo = true": "unknown key 'use_imo'",
        "alignment.residual = sfg": "residual: 'sfg' is unknown",
    }.items():
        config.write_text(f"[SgfOdometry]\n{line}\n")
        fails("sgf-odometry-cli", *arguments, parts=["section SgfOdometry", part])
    config.write_text("[SgfOdometry]\nsensor_label = OTHER\n")
    fails("sgf-odometry-cli", *arguments, parts=[dataset, "no stereo images", "of sensor OTHER"])
    config.write_text("[SgfOdometry]\nuse_imu = ${NOTHING}\n")
    fails("sgf-odometry-cli", *arguments, parts=["NOTHING"])
    tool("sgf-odometry-cli", *arguments[:4], "-c", MODULE / "config" / "sgf-odometry.ini")


def test_graph_slam_names_what_is_wrong(tmp_path):
    sample = (MODULE / "config" / "sgf-graphslam.ini").read_text()
    config = tmp_path / "graph.ini"
    dataset = room.write_euroc(tmp_path / "room", room.curve(2))
    arguments = ["-i", dataset, "-o", tmp_path / "out", "-c", config]
    for change, parts in {
        ("lc_candidates", "lc_candidate"): ["EdgeRegistrationDeciderParameters", "'lc_candidate'"],
        ("max_gap_s", "max_gap"): ["section SgfOdometry", "'max_gap'"],
        ("[NodeRegistration", "[Node"): ["NodeRegistrationDeciderParameters"],
        ("max_gap_s = 1.0", "sensor_label = OTHER"): [dataset, "no frame could be used"],
        ("", ""): [dataset, "not moved far enough"],
    }.items():
        config.write_text(sample.replace(*change) if change[0] else sample)
        fails("sgf-graphslam", *arguments, parts=parts)
    assert not list(tmp_path.glob("out*"))


# --- the installed package -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    prefix = tmp_path_factory.mktemp("prefix")
    module = BUILD / "mrpt_modules" / "mrpt_sgf_odometry"
    result = run("cmake", "--install", module, "--prefix", prefix)
    assert result.returncode == 0, result.stderr
    return prefix


def build_example(name, installed, folder):
    """Copies an example to a clean folder and builds it against the installed package."""
    shutil.copytree(installed / "share" / "mrpt-sgf-odometry" / "examples" / name, folder / name)
    for command in (
        ["cmake", "-S", folder / name, "-B", folder / "build", "-G", "Ninja",
         f"-DCMAKE_PREFIX_PATH={installed}"],
        ["cmake", "--build", folder / "build"],
    ):
        result = run(*command)
        assert result.returncode == 0, result.stdout + result.stderr
    return folder / "build" / f"sgf_{name}"


def test_the_stand_alone_example_prints_poses(installed, tmp_path):
    program = build_example("poses", installed, tmp_path)
    result = run(program, room.write_euroc(tmp_path / "room", room.curve(5)))
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("(x,y,z,yaw,pitch,roll)=") == 5
    assert "with pose: 5" in result.stdout
    assert run(program).returncode == 2


def test_the_stand_alone_example_leaves_out_no_frame_that_waits(installed, tmp_path):
    program = build_example("poses", installed, tmp_path)
    dataset, rawlog = room.write_euroc(tmp_path / "room", room.curve(5)), tmp_path / "in.rawlog"
    tool("dataset2rawlog", "-i", dataset, "-o", rawlog, "--no-imu")
    config = edited_ini("sgf-odometry.ini", tmp_path / "in.ini", estimator="stereo_inertial")
    result = run(program, rawlog, config)
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("(x,y,z,yaw,pitch,roll)=") == 5
    assert "with pose: 5" in result.stdout


def test_the_plug_in_example_needs_mrpt_only(installed, tmp_path):
    program = build_example("sensor", installed, tmp_path)
    dataset = room.write_euroc(tmp_path / "room", room.curve(5))
    config = edited_ini("rawlog-grabber.ini", tmp_path / "sensor.ini", path=dataset)
    assert "sgf-odometry" not in run("ldd", program).stdout
    result = run(program, config)
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("CObservationRobotPose") == 5
    assert run(program).returncode == 2


def test_programs_and_manuals_are_installed(installed):
    for name in ("sgf-odometry-cli", "dataset2rawlog", "sgf-graphslam"):
        assert run(installed / "bin" / name, "--help").returncode == 0
        assert (installed / "share" / "man" / "man1" / f"{name}.1").is_file()
    assert (installed / "share" / "mrpt-sgf-odometry" / "config" / "sgf-odometry.ini").is_file()
