#!/usr/bin/env bash
# The Dockerfile without a Docker engine: Debian's buildah builds the very same file, from what is committed, on a base
# that debootstrap makes, and runs the project in it as a user without a name. Never asks anything. Exit code 0: all
# went through; 1: a step failed and said where its log is; 2: wrong usage.
set -euo pipefail

usage() {
  cat <<'END'
Usage: tests/clean_room.sh [OPTION]... [STEP]...

Steps, in this order; default: table1 alone with --suite smoke, else all:
  table1      ./reproduce.sh --only table1, in the image
  run         ./reproduce.sh, in the image (half an hour on two cores, without the build, which the image has)
  verify      ./reproduce.sh --verify, in the image, of what the steps before it have made (10 minutes)
  packages    makes the Debian packages in the image, installs them in a bare Debian and tries them there
  test        ./reproduce.sh test, in the image (half an hour and more)

  --suite SUITE  build argument of the Dockerfile: full (the default) or smoke, which is for table1, run and verify
  --data DIR     folder with downloaded data sets, for table1, run and test
  --work DIR     for base, image, logs and results, 20 GB; default: build/clean_room
  --fresh        make base and image anew; else the base is kept, and the image if it is of the same commit
  --help         show this text and stop

Needs root, Debian's buildah, debootstrap and git, and package lists of Debian 12 (apt-get update): mirrors, settings
of downloads, and certificates are the host's.
END
}

wrong_usage() {
  printf 'clean_room.sh: %s (see --help)\n' "$1" >&2
  exit 2
}

fail() {
  printf 'Error: %s\n' "$1" >&2
  exit 1
}

# --- processes, containers, logs -------------------------------------------------------------------

# contained COMMAND...: in namespaces of its own: its processes and mounts end with it, however it ends.
contained() {
  env --default-signal=INT,QUIT unshare --mount --pid --fork --kill-child --mount-proc "$@" &
  child=$!
  wait "$child"
  child=
}

# At every exit: nothing runs on, no container is left, and a step that failed is named with the end of its log.
finish() {
  local code=$?
  trap - EXIT
  [[ -z $child ]] || kill -KILL "$child" 2>/dev/null || true
  wait 2>/dev/null
  "${buildah[@]}" rm --all >/dev/null 2>&1 || true
  [[ $code -eq 0 || -z $running ]] || {
    tail -n 30 "$logs/$running.log" >&3
    printf 'Error: %s failed or was interrupted; log: %s\n' "$running" "$logs/$running.log" >&3
    code=1
  }
  exit "$code"
}

# step NAME COMMAND...: runs it with its output in a log, and says how long it took.
step() {
  local start=$SECONDS
  running=$1
  shift
  printf '== %s\n' "$running"
  "$@" >"$logs/$running.log" 2>&1 </dev/null
  printf '  %d s; log: %s\n' "$((SECONDS - start))" "$logs/$running.log"
  running=
}

# --- base and image --------------------------------------------------------------------------------

# The host's sources of Debian 12, as lines of mirror and suite.
debian_sources() {
  # shellcheck disable=SC2016 # apt's own fields
  apt-get indextargets --format '$(REPO_URI) $(CODENAME)' \
    'Identifier: Packages' 'Component: main' 'Origin: Debian' | sort -u | grep -E ' bookworm(-updates|-security)?$'
}

# What Debian's slim images have: no documentation but copyright files, and no services that start.
make_slim() {
  cat >"$root/etc/dpkg/dpkg.cfg.d/slim" <<'END'
path-exclude /usr/share/doc/*
path-include /usr/share/doc/*/copyright
path-exclude /usr/share/info/*
path-exclude /usr/share/locale/*
path-exclude /usr/share/man/*
force-unsafe-io
END
  printf '#!/bin/sh\nexit 101\n' >"$root/usr/sbin/policy-rc.d"
  chmod +x "$root/usr/sbin/policy-rc.d"
}

use_hosts_mirrors() {
  local file keys=/usr/share/keyrings/debian-archive-keyring.gpg
  debian_sources | sed "s|.*|deb [signed-by=$keys] & main|" >"$root/etc/apt/sources.list"
  apt-config dump | grep '^Acquire::' | grep -v '^Acquire::IndexTargets' >"$root/etc/apt/apt.conf.d/01host"
  for file in /etc/ssl/certs/ca-certificates.crt /usr/local/share/ca-certificates; do
    [[ ! -e $file ]] || cp --dereference --recursive --parents "$file" "$root"
  done
}

make_base() {
  local container root mirror
  mirror=$(debian_sources | awk '$2 == "bookworm" { print $1; exit }')
  container=$("${buildah[@]}" from scratch)
  root=$("${buildah[@]}" mount "$container")
  contained debootstrap --variant=minbase bookworm "$root" "$mirror"
  rm -rf "$root"/var/cache/apt/archives/*.deb "$root"/var/lib/apt/lists/*
  make_slim
  use_hosts_mirrors
  "${buildah[@]}" config --cmd bash "$container"
  "${buildah[@]}" commit "$container" "$base"
  "${buildah[@]}" rm "$container"
}

build_image() {
  # Those of other commits are in the way: they are large.
  "${buildah[@]}" images --quiet --filter "reference=localhost/sgf-$suite" |
    xargs --no-run-if-empty "${buildah[@]}" rmi --force
  contained "${buildah[@]}" bud --isolation chroot --pull-never \
    --build-arg "BASE=$base" --build-arg "SUITE=$suite" --build-arg "REVISION=$commit" --tag "$image" "$work/source"
}

have_image() {
  "${buildah[@]}" inspect --type image "$1" >/dev/null 2>&1
}

export_source() {
  rm -rf "$work/source"
  mkdir "$work/source"
  git -C "$project" archive "$commit" | tar -x -C "$work/source"
}

# --- steps -----------------------------------------------------------------------------------------

# run_in CONTAINER [OPTION]... -- COMMAND...
run_in() {
  local container=$1
  local -a options=()
  shift
  while [[ $1 != -- ]]; do
    options+=("$1")
    shift
  done
  contained "${buildah[@]}" run --isolation chroot "${options[@]}" "$container" "$@"
}

# The container of all steps, and what is mounted into it: a clone's results/, and a folder for the packages.
make_container() {
  rm -rf "$work/results" "$work/packages"
  cp -r "$work/source/results" "$work/results"
  mkdir "$work/packages"
  chown -R "$user:$user" "$work/results" "$work/packages"
  "${buildah[@]}" from --pull-never --name project "$image"
}

# in_image COMMAND...: as `docker run` with the results folder, the data and the packages folder mounted.
in_image() {
  local -a mounts=(--volume "$work/results:/opt/beyond-photometric/results" --volume "$work/packages:/packages")
  [[ -z $data ]] || mounts+=(--volume "$data:/data:ro")
  run_in project --user "$user:$user" "${mounts[@]}" -- "$@"
}

step_table1() {
  in_image ./reproduce.sh --only table1 ${data:+--data /data}
  cat "$work/results/tables/table1.csv"
}

step_run() {
  in_image ./reproduce.sh ${data:+--data /data}
}

step_verify() {
  in_image ./reproduce.sh --verify
}

step_test() {
  in_image ./reproduce.sh test ${data:+--data /data}
}

step_packages() {
  local container
  in_image cmake --preset release
  in_image cpack --preset release -B /packages
  container=$("${buildah[@]}" from --pull-never "$base")
  run_in "$container" --volume "$work/packages:/packages:ro" --volume "$work/source/tests:/tests:ro" -- \
    /tests/packages/smoke.sh /packages
}

# --- command line ----------------------------------------------------------------------------------

every_step=(table1 run verify packages test)
user=4711 # any id that the image does not know
base=localhost/debian:bookworm-slim
suite=full
steps=()
data=
work=
fresh=false

while (($#)); do
  case $1 in
    table1 | run | verify | packages | test) steps+=("$1") ;;
    --suite)
      [[ ${2:-} == full || ${2:-} == smoke ]] || wrong_usage "--suite needs full or smoke, not '${2:-}'"
      suite=$2
      shift
      ;;
    --data)
      [[ -d ${2:-} ]] || wrong_usage "data folder '${2:-}' does not exist"
      data=$(realpath -- "$2")
      shift
      ;;
    --work)
      (($# > 1)) || wrong_usage "--work needs a folder"
      work=$2
      shift
      ;;
    --fresh) fresh=true ;;
    --help)
      usage
      exit 0
      ;;
    *) wrong_usage "unknown option or step '$1'" ;;
  esac
  shift
done

if ((${#steps[@]} == 0)); then
  steps=("${every_step[@]}")
  [[ $suite == full ]] || steps=(table1)
fi
[[ $suite == full || " ${steps[*]} " != *" "@(packages|test)" "* ]] || wrong_usage "an image of suite smoke has neither tests nor packages"

for program in apt-get buildah debootstrap flock git unshare; do
  command -v "$program" >/dev/null || fail "$program is not installed"
done
[[ $(id -u) -eq 0 ]] || fail "debootstrap and buildah need root here"
[[ -n $(debian_sources) ]] || fail "apt has no list of Debian 12's packages; apt-get update fetches those that /etc/apt names"
project=$(realpath -- "$(dirname -- "${BASH_SOURCE[0]}")/..")
commit=$(git -C "$project" rev-parse HEAD) || fail "$project is not a clone: what is built is the commit that is checked out"

mkdir -p -- "${work:=$project/build/clean_room}"
work=$(realpath -- "$work")
exec 3>&2 9>"$work/lock"
flock --nonblock 9 || fail "another clean room is at work in $work"
logs=$work/logs
mkdir -p "$logs"
export TMPDIR=$work
buildah=(buildah --root "$work/storage" --runroot "$work/storage/run" --storage-driver vfs)
image=localhost/sgf-$suite:$commit
child=   # process of contained()
running= # step
trap finish EXIT
trap 'exit 1' INT TERM HUP

if $fresh; then "${buildah[@]}" rmi --all --force >/dev/null; fi
have_image "$base" || step base make_base
step source export_source
have_image "$image" || step image build_image
step container make_container
for name in "${every_step[@]}"; do
  [[ " ${steps[*]} " != *" $name "* ]] || step "$name" "step_$name"
done
