#!/usr/bin/env bash
# Tries the project's Debian packages on a bare Debian 12 as root, where nothing else of the project is installed:
#   smoke.sh FOLDER     installs the packages in FOLDER with what they depend on, and uses them
# First the programs alone, then other projects that build against the libraries. Ends with 1 where anything fails.
set -euo pipefail
here=$(realpath -- "$(dirname -- "${BASH_SOURCE[0]}")")
[[ $# -eq 1 && -d $1 ]] || {
  printf 'smoke.sh: usage: smoke.sh FOLDER, with the packages in it\n' >&2
  exit 2
}
packages=$(realpath -- "$1")

say() {
  printf -- '-- %s\n' "$1"
}

# expect PATTERN COMMAND...: it ends well and its output has a line that matches.
expect() {
  local pattern=$1 output
  shift
  output=$("$@" 2>&1) || {
    printf '%s\nError: %s failed\n' "$output" "$*" >&2
    exit 1
  }
  grep -E -- "$pattern" <<<"$output" || {
    printf '%s\nError: no line of %s matches: %s\n' "$output" "$*" "$pattern" >&2
    exit 1
  }
}

# install PACKAGE...: with what it depends on, and nothing that it only recommends.
install() {
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"
}

# build SOURCES: a project of its own, which finds what is installed.
build() {
  cmake -S "$1" -B "$work/build_${1##*/}" -DCMAKE_BUILD_TYPE=Release
  cmake --build "$work/build_${1##*/}"
}

# A stereo pair and a flight of two frames, to be rendered.
write_recipes() {
  cat >"$work/pairs.yaml" <<'END'
pairs:
- {scene: living_room, view: sofa, width: 376, height: 240, focal_px: 229}
END
  cat >"$work/flight.yaml" <<'END'
scene: mocap_room_1
duration_s: 2
short: {from_s: 0.5, frames: 5}
trajectory:
  knot_interval_s: 0.4
  waypoints: [[0, 0, 1.5, 0, 0, 0], [0.1, 0, 1.5, 5, 0, 0], [0.2, 0, 1.5, 10, 0, 0]]
END
}

try_programs() {
  say "sgf-tools: a rendered pair is matched, a rendered flight tracked"
  sgf_render pair --recipe "$work/pairs.yaml" --preview --out "$work/pairs"
  sgf_render sequence "$work/flight.yaml" --preview --out "$work"
  local pair=$work/pairs/living_room_sofa
  sgf_stereo "$pair/im0.png" "$pair/im1.png" -o "$work/disparity" --gt "$pair/disp0GT.pfm"
  expect '"bad2_pct": ([0-9]|1[0-9])(\.|,|$)' cat "$work/disparity/scores.json"
  sgf_align "$work/flight" -o "$work/aligned"
  expect '.' cat "$work/aligned/trajectory.txt"
  say "mrpt-sgf-odometry: its programs"
  for program in sgf-odometry-cli dataset2rawlog sgf-graphslam; do
    expect 'Usage|USAGE' "$program" --help
  done
  dataset2rawlog -i "$work/flight" -o "$work/flight.rawlog"
  expect 'frames: 2, with pose: 2' sgf-odometry-cli -i "$work/flight.rawlog" -o "$work/mapped"
}

try_plugin() {
  say "mrpt-sgf-odometry: rawlog-grabber finds the plug-in by its name"
  sed "s|^path .*|path = $work/flight.rawlog|; s|^rawlog_prefix .*|rawlog_prefix = $work/grabbed|" \
    /usr/share/mrpt-sgf-odometry/config/rawlog-grabber.ini >"$work/grabber.ini"
  grab
  expect 'SGF' rawlog-edit --info -i "$work"/grabbed*.rawlog
}

# rawlog-grabber runs until its standard input ends: once it has saved what the flight gives.
grab() {
  local tenth
  mkfifo "$work/input"
  stdbuf -oL rawlog-grabber -p libmrpt-sgf-odometry-sensor.so "$work/grabber.ini" <"$work/input" >"$work/log" 2>&1 &
  exec 4>"$work/input"
  for ((tenth = 0; tenth < 600; tenth++)); do
    ! grep -q 'Saved [1-9]\|Exception' "$work/log" || break
    sleep 0.1
  done
  exec 4>&-
  wait "$!"
  cat "$work/log"
}

try_libraries() {
  say "libsgf-dev: a project that links sgf::stereo"
  build "$here/../tools/consumer"
  expect '^disparity 7$' "$work/build_consumer/consumer"
  say "libsgf-dev: the examples that it installs"
  build /usr/share/sgf/examples
  expect '^2 of 2 frames have a pose$' "$work/build_examples/keyframe_odometry" "$work/flight" "$work/path.txt"
  say "libmrpt-sgf-odometry-dev: the examples that it installs"
  build /usr/share/mrpt-sgf-odometry/examples/poses
  expect 'with pose: 2' "$work/build_poses/sgf_poses" "$work/flight.rawlog"
  build /usr/share/mrpt-sgf-odometry/examples/sensor
  expect 'CObservationRobotPose' "$work/build_sensor/sgf_sensor" "$work/grabber.ini"
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
write_recipes
say "install"
apt-get update -qq
install "$packages"/sgf-tools_*.deb "$packages"/mrpt-sgf-odometry_*.deb
try_programs
install mrpt-apps
try_plugin
install "$packages"/lib*.deb cmake g++ make
try_libraries
say "all packages work"
