"""A textured room of 8 x 6 x 3 m, seen by a robot, in the folder layouts of data sets."""

import numpy as np
from PIL import Image
from scipy.interpolate import CubicSpline

SIZE = (240, 320)  # rows, columns
FOCAL = 200.0  # px
BASELINE = 0.12  # m
PERIOD_NS = 50_000_000
START_NS = 1_600_000_000_000_000_000
HALF = np.array([4.0, 3.0, 1.5])  # m
TEXEL = 0.04  # m
# Camera on the robot: axes (x right, y down, z forward) and place.
R_ROBOT_CAM = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
P_ROBOT_CAM = np.array([0.1, 0.0, 0.5])


def _textures():
    random = np.random.default_rng(5)
    coarse = random.uniform(0, 1, (6, 40, 40)).repeat(6, axis=1).repeat(6, axis=2)
    fine = random.uniform(0, 1, (6, 240, 240))
    return 25 + 110 * coarse + 90 * fine


TEXTURES = _textures()


def yaw_matrix(yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def _wall_colour(points, axis, positive):
    """Bilinear lookup of the wall that each point lies on."""
    u = np.where(axis == 0, points[..., 1], points[..., 0]) / TEXEL + 110
    v = np.where(axis == 2, points[..., 1], points[..., 2]) / TEXEL + 110
    wall = 2 * axis + positive
    x, y = u.astype(int), v.astype(int)
    fx, fy = u - x, v - y
    top = TEXTURES[wall, y, x] * (1 - fx) + TEXTURES[wall, y, x + 1] * fx
    bottom = TEXTURES[wall, y + 1, x] * (1 - fx) + TEXTURES[wall, y + 1, x + 1] * fx
    return top * (1 - fy) + bottom * fy


def look(rotation, position):
    """Image and depth of a camera with axes `rotation` in the room."""
    rows, columns = SIZE
    y, x = np.mgrid[0:rows, 0:columns].astype(float)
    rays = np.stack([(x - (columns - 1) / 2) / FOCAL, (y - (rows - 1) / 2) / FOCAL, np.ones(SIZE)], -1)
    rays = rays @ rotation.T
    with np.errstate(divide="ignore"):
        depths = (np.copysign(HALF, rays) - position) / rays
    axis = depths.argmin(-1)
    depth = depths.min(-1)
    positive = np.take_along_axis(rays, axis[..., None], -1)[..., 0] > 0
    points = position + depth[..., None] * rays
    grey = _wall_colour(points, axis, positive)
    return np.round(grey).clip(0, 255).astype(np.uint8), depth


def robot_views(x, y, yaw):
    """Left image, right image and left depth of a robot on the floor."""
    R = yaw_matrix(yaw)
    rotation = R @ R_ROBOT_CAM
    left = np.array([x, y, 0]) + R @ P_ROBOT_CAM
    right = left + rotation @ [BASELINE, 0, 0]
    grey, depth = look(rotation, left)
    return grey, look(rotation, right)[0], depth


def curve(frames):
    """x, y, yaw of a gentle curve from the origin."""
    i = np.arange(frames)
    return np.stack([0.03 * i, 0.001 * i**2, 0.01 * i], 1)


def slalom(frames):
    """x, y, yaw of a lively drive from the origin, speeding up and braking."""
    t = PERIOD_NS * 1e-9 * np.arange(frames)
    return np.stack([0.5 * np.sin(1.5 * t), 0.2 * (1 - np.cos(2 * t)), 0.2 * np.sin(1.1 * t)], 1)


def circle(frames, radius=1.2):
    """Once around, from the origin back to it."""
    angle = np.linspace(0, 2 * np.pi, frames)
    return np.stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), angle], 1)


def times_ns(frames):
    return START_NS + PERIOD_NS * np.arange(frames)


def _sensor_yaml(T):
    rows, columns = SIZE
    return (
        "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
        f"  data: {[float(v) for v in T.ravel()]}\nrate_hz: 20\nresolution: [{columns}, {rows}]\n"
        "camera_model: pinhole\n"
        f"intrinsics: [{FOCAL}, {FOCAL}, {(columns - 1) / 2}, {(rows - 1) / 2}]\n"
        "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n"
    )


def write_euroc(folder, path):
    """A sequence in EuRoC's layout, with an inertial sensor whose axes are the robot's."""
    mav0 = folder / "mav0"
    stamps = times_ns(len(path))
    for camera in (0, 1):
        images = mav0 / f"cam{camera}" / "data"
        images.mkdir(parents=True)
        T = np.eye(4)
        T[:3, :3] = R_ROBOT_CAM
        T[:3, 3] = P_ROBOT_CAM + R_ROBOT_CAM @ [BASELINE * camera, 0, 0]
        (images.parent / "sensor.yaml").write_text(_sensor_yaml(T))
        rows = "".join(f"{t},{t}.png\n" for t in stamps)
        (images.parent / "data.csv").write_text("#timestamp [ns],filename\n" + rows)
    for stamp, pose in zip(stamps, path):
        left, right, _ = robot_views(*pose)
        Image.fromarray(left).save(mav0 / "cam0" / "data" / f"{stamp}.png")
        Image.fromarray(right).save(mav0 / "cam1" / "data" / f"{stamp}.png")
    (mav0 / "body.yaml").write_text("comment: a robot\n")
    _write_imu(mav0 / "imu0", path)
    return folder


def _inertial_rows(path):
    """Time, rates and accelerations of the robot, with gravity; none is at a frame's time."""
    seconds = PERIOD_NS * 1e-9 * np.arange(len(path))
    spline = CubicSpline(seconds, path)
    for k in range(10 * len(path)):
        offset_ns = 2_000_000 + k * PERIOD_NS // 10
        t = min(offset_ns * 1e-9, seconds[-1])
        x, y = yaw_matrix(spline(t)[2])[:2, :2].T @ spline(t, 2)[:2]
        yield START_NS + offset_ns, 0, 0, spline(t, 1)[2], x, y, 9.81


def _write_imu(folder, path):
    folder.mkdir()
    T = [float(v) for v in np.eye(4).ravel()]
    (folder / "sensor.yaml").write_text(
        f"sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: {T}\nrate_hz: 200\n"
        "gyroscope_noise_density: 1.0e-4\ngyroscope_random_walk: 1.0e-5\n"
        "accelerometer_noise_density: 1.0e-3\naccelerometer_random_walk: 1.0e-3\n"
    )
    rows = [",".join(map(str, row)) + "\n" for row in _inertial_rows(path)]
    (folder / "data.csv").write_text("#timestamp,wx,wy,wz,ax,ay,az\n" + "".join(rows))


def write_kitti(folder, path):
    """A sequence in the layout of KITTI odometry; returns its folder."""
    sequence = folder / "dataset" / "sequences" / "90"
    for camera in (0, 1):
        (sequence / f"image_{camera}").mkdir(parents=True)
    for i, pose in enumerate(path):
        left, right, _ = robot_views(*pose)
        Image.fromarray(left).save(sequence / "image_0" / f"{i:06}.png")
        Image.fromarray(right).save(sequence / "image_1" / f"{i:06}.png")
    cx, cy = (SIZE[1] - 1) / 2, (SIZE[0] - 1) / 2
    lines = [
        f"P{c}: {FOCAL} 0 {cx} {-FOCAL * BASELINE * c} 0 {FOCAL} {cy} 0 0 0 1 0\n" for c in (0, 1)
    ]
    (sequence / "calib.txt").write_text("".join(lines))
    (sequence / "times.txt").write_text("".join(f"{0.05 * i:.6f}\n" for i in range(len(path))))
    return sequence


def write_tum(folder, path):
    """A sequence in the layout of TUM RGB-D, at that data set's intrinsics."""
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    rows = []
    for i, pose in enumerate(path):
        grey, _, depth = robot_views(*pose)
        Image.fromarray(np.stack([grey] * 3, 2)).save(folder / "rgb" / f"{i}.png")
        levels = np.round(depth * 5000).astype(np.uint16)
        Image.fromarray(levels).save(folder / "depth" / f"{i}.png")
        stamp = f"{1.3e9 + 0.05 * i:.6f}"
        rows.append(f"{stamp} rgb/{i}.png {stamp} depth/{i}.png\n")
    (folder / "associations.txt").write_text("".join(rows))
    return folder
