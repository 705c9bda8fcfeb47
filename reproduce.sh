#!/usr/bin/env bash
# From a fresh Debian 12 machine to every table and figure (./reproduce.sh), or through the whole
# test suite (./reproduce.sh test). Never asks anything. Exit code 0: done; 1: a step failed and said
# where its log is; 2: wrong usage.
set -euo pipefail

caller=$PWD
cd -- "$(dirname -- "${BASH_SOURCE[0]}")"
project=$PWD
logs=$project/results/logs
bin=$project/build/release/bin

# Debian's Python with Debian's packages, whatever else the caller has installed or set.
python=/usr/bin/python3
unset PYTHONPATH PYTHONHOME
export PYTHONNOUSERSITE=1

usage() {
  cat <<'END'
Usage: ./reproduce.sh [OPTION]...        install what is missing, build, run the experiments
       ./reproduce.sh test [OPTION]...   the same set-up, then the whole test suite
       ./reproduce.sh --verify           repeat a sample of the runs and compare what they make

  --only NAME...  only these experiments (see --list); `tune`, which takes an hour, runs only so
  --data DIR      folder with downloaded data sets; default: environment variable SGF_DATA, or none.
                  Without it the pairs that Debian packages ship are used.
  --sanitize      test: only the C++ unit tests, under the address and undefined-behaviour sanitizers
  --full          the paper's own data sets at the paper's own sizes: fetch those that the experiments
                  use (26 GB of archives for all) into --data, or datasets/downloaded without it, and
                  render the full suite of eleven sequences (15 GB at most) instead of four (2 GB at most)
  --accept-licences  --full: you accept the licences of the data sets, which it shows; without this
                  nothing is downloaded and the run goes on with what is at hand
  --runs N        runs of each line of the tables that repeat runs (odometry, table3);
                  default: a few, for a quick look; rankings take 10, shares of success 25
  --jobs N        parallel jobs; default: the number of processors
  --cluster slurm build here, on all processors, and submit each job to Slurm (docs/scaling.md), --jobs of
                  them at a time, 200 by default; project and data have to lie in folders that all nodes share
  --verify        run a sample of what was made again, one of each kind and about ten minutes in all, and
                  compare: bit for bit on the same machine with the same packages and code, else within
                  paper/tolerances.yaml; exit code 1 if anything differs or nothing was made
  --list          list the experiments and stop
  --clean         remove what was built and generated (not results/reference and results/external) and stop
  --help          show this text and stop

With test go --data, --jobs and --sanitize; --verify, --list and --clean stand alone.

Results: results/report.html and .pdf, results/tables, results/figures; logs: results/logs. What is up to
date is not made again, and an interrupted run goes on where it stopped.
END
}

wrong_usage() {
  printf 'reproduce.sh: %s (see --help)\n' "$1" >&2
  exit 2
}

fail() {
  printf 'Error: %s\n' "$1" >&2
  exit 1
}

# --- experiments ---------------------------------------------------------------------------------

experiment_names() {
  local file
  for file in paper/experiments/*.yaml; do
    basename "$file" .yaml
  done
}

# Those that run when none is named: not those that take hours.
default_names() {
  grep -L '^by_name_only: true$' paper/experiments/*.yaml | xargs -n 1 basename -s .yaml
}

list_experiments() {
  local name title
  for name in $(experiment_names); do
    title=$(sed -n 's/^title: *"\(.*\)" *$/\1/p' "paper/experiments/$name.yaml")
    printf '%-14s %s\n' "$name" "$title"
  done
}

require_experiment() {
  [[ $1 != */* && -f paper/experiments/$1.yaml ]] ||
    wrong_usage "unknown experiment '$1'; known: $(experiment_names | paste -sd ' ')"
}

# --- packages ------------------------------------------------------------------------------------

# packages_of SECTION...: the packages of these sections of packages.apt, one a line.
packages_of() {
  awk -v wanted=" $* " '
    { sub(/#.*/, ""); gsub(/[ \t]+/, "") }
    /^\[.*\]$/ { section = substr($0, 2, length($0) - 2); next }
    $0 != "" && index(wanted, " " section " ") { print }' packages.apt
}

# missing_packages SECTION...: those of them that are not installed.
missing_packages() {
  local -a wanted
  mapfile -t wanted < <(packages_of "$@")
  printf '%s\n' "${wanted[@]}" | grep -vxFf \
    <(dpkg-query -W -f '${db:Status-Status} ${Package}\n' "${wanted[@]}" 2>/dev/null | sed -n 's/^installed //p') || true
}

# print_manual_install PACKAGE...: what to do without the right to install.
print_manual_install() {
  cat >&2 <<END
These packages are missing, and installing needs root or sudo without a password:

  sudo apt-get update && sudo apt-get install -y --no-install-recommends $*

Or run everything in a container:

  docker build -t sgf --build-arg REVISION="\$(git describe --always --dirty --abbrev=40)" .
  docker run --rm --user "\$(id -u):\$(id -g)" \\
    -v "\$PWD/results:/opt/beyond-photometric/results" sgf
END
}

# apt-get as root, with its output in a log.
apt_get() {
  local -a command=(env DEBIAN_FRONTEND=noninteractive apt-get -y -o DPkg::Lock::Timeout=600 "$@")
  [[ $(id -u) -eq 0 ]] || command=(sudo -n "${command[@]}")
  "${command[@]}" >>"$logs/packages.log" 2>&1 </dev/null ||
    fail "apt-get $1 failed; log: $logs/packages.log"
}

# install_packages SECTION...: those that are missing; the first step of whatever leaves logs.
install_packages() {
  local -a missing
  mkdir -p "$logs"
  printf '== packages%s\n' "$(printf ' [%s]' "$@")"
  command -v dpkg-query >/dev/null ||
    fail "this is not a Debian system; use the Dockerfile, or install what packages.apt lists"
  mapfile -t missing < <(missing_packages "$@")
  if ((${#missing[@]} == 0)); then
    printf '  all of%s are installed\n' "$(printf ' [%s]' "$@")"
    return
  fi
  if [[ $(id -u) -ne 0 ]] && ! sudo -n true 2>/dev/null; then
    print_manual_install "${missing[@]}"
    exit 1
  fi
  printf '  installing %d: %s\n' "${#missing[@]}" "${missing[*]}"
  : >"$logs/packages.log"
  apt_get update
  apt_get install --no-install-recommends "${missing[@]}"
}

# --- build ---------------------------------------------------------------------------------------

# Turns Ninja's lines into one progress line per tenth; keeps all of them in the log $1.
build_progress() {
  awk -v log_file="$1" '
    function clock(s) { return sprintf("%d:%02d", s / 60, s % 60) }
    { print > log_file }
    match($0, /^\[[0-9]+\/[0-9]+ [0-9.]+\]/) {
      split(substr($0, 2, RLENGTH - 2), part, /[\/ ]/)
      done = part[1]; total = part[2]; elapsed = part[3]
      if (int(10 * done / total) > tenth) {
        tenth = int(10 * done / total)
        printf "  [%d/%d] elapsed %s, about %s left\n", done, total, clock(elapsed),
          clock(elapsed * (total - done) / done)
        fflush()
      }
    }'
}

# configure PRESET TESTS: TESTS is ON or OFF.
configure() {
  cmake --preset "$1" "-DSGF_BUILD_TESTS=$2" >"$logs/configure.log" 2>&1 || {
    tail -n 20 "$logs/configure.log" >&2
    fail "configuring failed; log: $logs/configure.log"
  }
}

# build PRESET [TARGET...]: builds the targets, or the preset's.
build() {
  local preset=$1 log=$logs/build.log
  shift
  NINJA_STATUS='[%f/%t %e] ' cmake --build --preset "$preset" --parallel "$jobs" ${1+--target "$@"} 2>&1 |
    build_progress "$log" || {
    grep -m 5 -A 5 'error' "$log" >&2 || tail -n 20 "$log" >&2
    fail "building failed; log: $log"
  }
  printf '  built in %s\n' "$project/build/$preset"
}

# Whether the build folder was configured with tests: a developer's stays so.
tests_in_build() {
  grep -qs '^SGF_BUILD_TESTS:BOOL=ON$' build/release/CMakeCache.txt && echo ON || echo OFF
}

# Those programs of the MRPT module that experiments run; none where MRPT is missing.
mrpt_programs() {
  if grep -qs '^build sgf-odometry-cli:' build/release/build.ninja; then
    printf '%s\n' dataset2rawlog sgf-odometry-cli
  fi
}

# --- commands ------------------------------------------------------------------------------------

# A run holds results/.lock (paper/sgf_paper/file_lock.py); one that was killed may take a moment to let go of it.
clean() {
  local -a made
  local problems
  if [[ -e results/.lock ]]; then
    { exec 9>>results/.lock; } 2>/dev/null || fail "$project/results belongs to another user; nothing was removed"
    flock --timeout 5 9 || fail "a run is at work in $project/results; nothing was removed"
  fi
  mapfile -d '' -t made < <(find results -mindepth 1 -maxdepth 1 ! -name reference ! -name external -print0 2>/dev/null)
  problems=$(rm -rf build/release build/sanitize build/fuzz datasets/generated "${made[@]}" 2>&1) ||
    fail "not everything could be removed: $(head -n 1 <<<"$problems")"
  echo "Removed build/release, build/sanitize, build/fuzz, datasets/generated and all of results but reference and external."
}

# What cannot be fetched is said; the run goes on with what is at hand.
fetch_datasets() {
  echo "== data sets to download"
  "$python" datasets/fetch --for "${stages[@]}" --into "$data" "${accepted[@]}" 2>&1 |
    tee "$logs/fetch.log" ||
    printf '  going on with the data sets at hand; log: %s\n' "$logs/fetch.log"
}

run_experiments() {
  local -a mrpt
  install_packages run report
  ((${#full[@]} == 0)) || fetch_datasets
  echo "== build"
  configure release "$(tests_in_build)"
  mapfile -t mrpt < <(mrpt_programs)
  ((${#mrpt[@]})) ||
    printf '  the MRPT module and what it shows are left out; why: %s\n' "$logs/configure.log"
  build release sgf_align sgf_direct sgf_eval sgf_render sgf_stereo sgf_study sgf_vio stereo_bench "${mrpt[@]}"
  cd paper
  exec "$python" -m sgf_paper.run --bin "$bin" --data "$data" --jobs "$at_once" "${cluster[@]}" "${full[@]}" \
    "${runs[@]}" "${stages[@]}"
}

run_tests() {
  local -a sections=(run report test)
  [[ $preset != sanitize ]] || sections+=(sanitize)
  install_packages "${sections[@]}"
  echo "== build"
  configure "$preset" ON
  build "$preset"
  echo "== tests"
  if [[ -n $data ]]; then export SGF_DATA=$data; fi
  exec ctest --preset "$preset" --parallel "$jobs"
}

# Without anything on record Python is not asked: on a fresh machine it lacks its packages.
verify_runs() {
  [[ -n $(find results/raw results/runs -name run.json -print -quit 2>/dev/null) ]] ||
    fail "no finished run in $project/results; run ./reproduce.sh first"
  install_packages run report
  cd paper
  exec "$python" -m sgf_paper.verify --results "$project/results"
}

# require_number OPTION [VALUE]...: the value of an option that takes a positive number.
require_number() {
  [[ ${2:-} =~ ^[1-9][0-9]*$ ]] || wrong_usage "$1 needs a positive number, not '${2:-}'"
}

# --- command line --------------------------------------------------------------------------------

# The modes that each option goes with; `run` is that of a command line without one.
declare -A goes_with=(
  [--only]=run [--data]="run test" [--sanitize]=test [--full]=run [--accept-licences]=run
  [--runs]=run [--jobs]="run test" [--cluster]=run
)

mode=
given=()
stages=()
preset=release
full=()
accepted=()
runs=()
data=${SGF_DATA:-}
jobs=
cluster=()

while (($#)); do
  given+=("$1")
  case $1 in
    test | --list | --clean | --verify)
      [[ -z $mode || $mode == "$1" ]] || wrong_usage "$1 does not go with $mode"
      mode=$1
      ;;
    --only)
      [[ ${2:--} != -* && $2 != test ]] || wrong_usage "--only needs the name of an experiment"
      while (($# > 1)) && [[ $2 != -* && $2 != test ]]; do
        require_experiment "$2"
        stages+=("$2")
        shift
      done
      ;;
    --data)
      [[ -n ${2:-} ]] || wrong_usage "--data needs a folder"
      data=$2
      shift
      ;;
    --sanitize) preset=sanitize ;;
    --full) full=(--full) ;;
    --accept-licences) accepted=(--accept-licences) ;;
    --runs)
      require_number "$@"
      runs=(--runs "$2")
      shift
      ;;
    --jobs)
      require_number "$@"
      jobs=$2
      shift
      ;;
    --cluster)
      [[ ${2:-} == slurm ]] || wrong_usage "--cluster needs the kind of cluster: slurm"
      cluster=(--cluster slurm)
      shift
      ;;
    --help)
      usage
      exit 0
      ;;
    *) wrong_usage "unknown option '$1'" ;;
  esac
  shift
done

mode=${mode:-run}
for option in "${given[@]}"; do
  [[ " ${goes_with[$option]:-$mode} " == *" $mode "* ]] ||
    wrong_usage "$option does not go with ${mode/#run/a run of experiments}"
done
if [[ ${#accepted[@]} -gt 0 && ${#full[@]} -eq 0 ]]; then
  wrong_usage "--accept-licences goes with --full only"
fi
if ((${#cluster[@]})); then
  command -v sbatch >/dev/null || fail "sbatch is not installed: is this a machine of the cluster?"
fi
if [[ ${#full[@]} -gt 0 && -z $data ]]; then
  data=$project/datasets/downloaded
  mkdir -p "$data"
fi
if [[ -n $data ]]; then
  cd -- "$caller"
  [[ -d $data ]] || wrong_usage "data folder '$data' does not exist"
  data=$(realpath -- "$data")
  cd -- "$project"
fi
if ((${#cluster[@]})); then
  at_once=${jobs:-200}
  jobs=$(nproc) # of the build, which is made here
else
  jobs=${jobs:-$(nproc)}
  at_once=$jobs
fi
((${#stages[@]})) || mapfile -t stages < <(default_names)

case $mode in
  --list) list_experiments ;;
  --clean) clean ;;
  --verify) verify_runs ;;
  run) run_experiments ;;
  test) run_tests ;;
esac
