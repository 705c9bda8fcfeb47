"""Runs a command and leaves what it was made of: `run.json`, and beside it `timing.json`.

    python3 -m sgf_paper.record RULE FOLDER --inputs PATH... --outputs PATH... -- COMMAND...

`run.json` says what a result depends on and nothing that differs between two equal runs on one machine:
commit and diff, the command, its options and seeds, hashes of all it read and made, versions of packages,
the processor and the instruction set in use, and how the run ended. What differs from run to run, when and
where it ran and what it took, is in `timing.json`. Both are written when the run ends, be it in failure or by
a signal; `state: started` in `run.json` is left by a run that was killed together with this program.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import platform
import re
import signal
import subprocess
import sys
import time
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import yaml

PROJECT = Path(__file__).resolve().parents[2]
CACHE = Path(".cache") / "hashes"  # in the results, where runs are started
DIFFS = Path("runs") / "diffs"
CACHED_BYTES = 1 << 22  # smaller files are hashed as fast as a hash is looked up
PACKAGE_SECTIONS = ("run", "report")
LIBRARIES = ("libc6", "libstdc++6")  # what all programs stand on, and packages.apt need not name
SIMD_FLAGS = re.compile(r"sse\w*|ssse3|avx\w*|fma|f16c|neon|asimd\w*|sve\w*")


def write_text(path: Path, text: str) -> None:
    """Writes a file under a temporary name and renames it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(text)
    temporary.replace(path)


def _plain(node: Any) -> Any:
    """What JSON can hold: numbers that are not finite, and dates, become text."""
    if isinstance(node, dict):
        return {str(key): _plain(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_plain(value) for value in node]
    plain = node is None or isinstance(node, (str, int)) or (isinstance(node, float) and math.isfinite(node))
    return node if plain else str(node)


def write_json(path: Path, node: Any) -> None:
    write_text(path, json.dumps(_plain(node), indent=1, ensure_ascii=False) + "\n")


# --- hashes ---------------------------------------------------------------------------------------


def _files_of(path: Path) -> list[Path]:
    return sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]


def _hash_file(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _hash_content(path: Path, files: list[Path]) -> str:
    """A file's SHA-256; of a folder that of the lines `hash  path` of its files, as sha256sum prints them."""
    if not path.is_dir():
        return _hash_file(path)
    lines = [f"{_hash_file(file)}  {file.relative_to(path)}\n" for file in files]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def hash_path(path: Path, cache: Path) -> str:
    """SHA-256 of a file or folder; what is large is hashed again only once a size or time has changed."""
    files = _files_of(path)
    stats = [(str(file), file.stat().st_size, file.stat().st_mtime_ns) for file in files]
    if sum(size for _, size, _ in stats) < CACHED_BYTES:
        return _hash_content(path, files)
    seen = hashlib.sha256(repr(stats).encode()).hexdigest()
    kept = cache / f"{hashlib.sha256(str(path.resolve()).encode()).hexdigest()}.json"
    if kept.exists():
        known = json.loads(kept.read_text())
        if known["seen"] == seen:
            return known["sha256"]
    digest = _hash_content(path, files)
    write_json(kept, {"path": str(path), "seen": seen, "sha256": digest})
    return digest


def hash_each(paths: list[Path], cache: Path) -> dict[str, str]:
    """Hashes of what there is of these files and folders."""
    return {str(path): hash_path(path, cache) for path in paths if path.exists()}


def hash_outputs(paths: list[Path], cache: Path) -> dict[str, str]:
    """Hashes of files and of all files in folders, one by one."""
    return hash_each([file for path in paths if path.exists() for file in _files_of(path)], cache)


# --- what a result depends on ---------------------------------------------------------------------


def _output_of(*command: str | Path) -> str:
    """What a command prints; nothing if it is not there or fails."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
    except OSError:
        return ""
    return done.stdout if done.returncode == 0 else ""


def _note_unknown(name: str) -> str:
    """A line on a file that git does not know: its hash, or why it has none, which ends no run."""
    try:
        digest = hash_path(PROJECT / name, CACHE)
    except OSError as error:
        digest = error.strerror
    return f"# not in git: {name} {digest}\n"


def describe_code(diffs: Path) -> dict[str, str]:
    """Commit of the project and the hash of what differs from it, which is kept as <hash>.patch in `diffs`.

    Files that git does not know count by name and hash. Without git it is what the file REVISION says, which the
    Dockerfile writes, or else `unknown`.
    """
    git = ("git", "-C", PROJECT)
    commit = _output_of(*git, "rev-parse", "HEAD").strip() if (PROJECT / ".git").exists() else ""
    if not commit:
        revision = PROJECT / "REVISION"
        return {"commit": revision.read_text().strip() if revision.exists() else "unknown", "diff": ""}
    diff = _output_of(*git, "diff", "--binary", "HEAD")
    unknown = _output_of(*git, "ls-files", "-z", "--others", "--exclude-standard").split("\0")[:-1]
    diff += "".join(map(_note_unknown, unknown))
    if not diff:
        return {"commit": commit, "diff": ""}
    digest = hashlib.sha256(diff.encode()).hexdigest()
    if not (diffs / f"{digest}.patch").exists():
        write_text(diffs / f"{digest}.patch", diff)
    return {"commit": commit, "diff": digest}


def packages_of(*sections: str) -> list[str]:
    """Packages of these sections of packages.apt."""
    names, section = [], ""
    for line in (PROJECT / "packages.apt").read_text().splitlines():
        text = line.split("#")[0].strip()
        if text.startswith("["):
            section = text.strip("[]")
        elif text and section in sections:
            names.append(text)
    return names


def describe_packages() -> dict[str, str]:
    """Installed versions of the packages that programs and tables are made with."""
    names = [*packages_of(*PACKAGE_SECTIONS), *LIBRARIES]
    form = "${db:Status-Abbrev}\t${Package}\t${Version}\n"
    command = ["dpkg-query", "--no-pager", "-W", "-f", form, *names]
    try:  # it fails for a name that is not known, and prints the others
        printed = subprocess.run(command, capture_output=True, text=True).stdout
    except OSError:
        return {}
    lines = [line.split("\t") for line in printed.splitlines()]
    return {fields[1]: fields[2] for fields in sorted(lines) if fields[0].startswith("ii")}


def describe_processor() -> dict[str, str]:
    """Model and vector extensions: libraries choose code by them."""
    text = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"^model name\s*: (.*)$", text, re.MULTILINE)
    flags = re.search(r"^(?:flags|Features)\s*: (.*)$", text, re.MULTILINE)
    known = {flag for flag in (flags[1].split() if flags else []) if SIMD_FLAGS.fullmatch(flag)}
    return {
        "architecture": platform.machine(),
        "model": model[1].strip() if model else "unknown",
        "flags": " ".join(sorted(known)),
    }


def describe_build(files: list[Path]) -> dict[str, str]:
    """What the programs among these files say of their build and of the instruction set in use.

    sgf_eval, which is built with the others, speaks for all.
    """
    teller = next((f.with_name("sgf_eval") for f in files if f.with_name("sgf_eval").exists()), None)
    node = yaml.safe_load(_output_of(teller, "build")) if teller else None
    return node if isinstance(node, dict) else {}


def conditions(inputs: list[Path]) -> dict[str, Any]:
    """All that a result depends on, besides the command: as it is now, in the results as working directory.

    @param inputs what is read, programs of the build included.
    """
    return {
        "code": describe_code(DIFFS),
        "inputs": hash_each(inputs, CACHE),
        "packages": describe_packages(),
        "processor": describe_processor(),
        "build": describe_build(inputs),
    }


def find_options(outputs: list[Path], inputs: list[Path]) -> dict[str, Any]:
    """All options of a run: the file that its program left of them, or else the files it was given, by their names."""
    beside = [path / "options.yaml" for path in outputs]
    beside += [path.with_suffix(".options.yaml") for path in outputs]
    beside += [path.with_name("options.yaml") for path in outputs if path.name == "trajectory.txt"]
    for path in beside:
        if path.is_file():
            return yaml.safe_load(path.read_text()) or {}
    given = [path for path in inputs if path.parent.name in ("experiments", "synthetic") and path.is_file()]
    return {path.stem: yaml.safe_load(path.read_text()) for path in given}


def find_seeds(options: Any, command: list[str], prefix: str = "") -> dict[str, Any]:
    """All options whose names end in `seed`, by their dotted names, and flags of a command that end so."""
    items = enumerate(options) if isinstance(options, list) else options.items() if isinstance(options, dict) else []
    found = {}
    for key, value in items:
        if isinstance(value, (dict, list)):
            found |= find_seeds(value, [], f"{prefix}{key}.")
        elif str(key).endswith("seed"):
            found[f"{prefix}{key}"] = value
    for flag, value in zip(command, command[1:]):
        if flag.startswith("--") and flag.endswith("seed"):
            found[flag] = value
    return found


# --- the run --------------------------------------------------------------------------------------


class Run:
    """One command, from before its start to after its end."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self.arguments = arguments
        self.node: dict[str, Any] = {}

    @property
    def command(self) -> list[str]:
        return self.arguments.command

    def write(self, state: dict[str, Any]) -> None:
        write_json(self.arguments.folder / "run.json", {**self.node, "exit": state})

    def describe(self) -> None:
        """All that can be known before the run."""
        self.node = {
            "rule": self.arguments.rule,
            "command": self.command,
            **conditions(self.arguments.inputs),
        }

    def start(self) -> subprocess.Popen:
        """Starts the command; signals that end this program are handed on to it."""
        child = subprocess.Popen(self.command)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, lambda received, _: child.send_signal(received))
        return child

    def finish(self, state: dict[str, Any]) -> None:
        """Adds what the run has left."""
        options = find_options(self.arguments.outputs, self.arguments.inputs)
        self.node |= {
            "options": options,
            "seeds": find_seeds(options, self.command),
            "outputs": hash_outputs(self.arguments.outputs, CACHE),
        }
        self.write(state)


def exit_state(status: int) -> dict[str, Any]:
    """How a process ended, by what wait4() says."""
    if os.WIFSIGNALED(status):
        return {"state": "killed", "signal": signal.Signals(os.WTERMSIG(status)).name}
    code = os.WEXITSTATUS(status)
    return {"state": "done" if code == 0 else "failed", "code": code}


def describe_time(started: float, wall_s: float, usage: Any) -> dict[str, Any]:
    """When and where a command ran and what it took, its own children included.

    Its peak memory is that of its largest process, and not less than this program's own.
    """
    return {
        "started": datetime.fromtimestamp(started, timezone.utc).isoformat(timespec="seconds"),
        "node": platform.node(),
        "wall_s": round(wall_s, 3),
        "cpu_s": round(usage.ru_utime + usage.ru_stime, 3),
        "peak_mib": round(usage.ru_maxrss / 1024, 1),
    }


def record(arguments: argparse.Namespace) -> int:
    """Runs a command and writes both files. @returns its exit code; 128 and the signal's number if killed."""
    run = Run(arguments)
    run.describe()
    run.write({"state": "started"})
    started, clock = time.time(), time.perf_counter()
    child = run.start()
    _, status, usage = os.wait4(child.pid, 0)
    wall_s = time.perf_counter() - clock
    child.returncode = 0  # waited for
    run.finish(exit_state(status))
    write_json(arguments.folder / "timing.json", describe_time(started, wall_s, usage))
    return 128 + os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)


def parse_arguments(words: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="sgf_paper.record", description=__doc__)
    parser.add_argument("rule", help="what kind of run it is")
    parser.add_argument("folder", type=Path, help="for run.json and timing.json")
    parser.add_argument("--inputs", type=Path, nargs="*", default=[], help="files and folders it reads")
    parser.add_argument("--outputs", type=Path, nargs="*", default=[], help="files and folders it makes")
    if "--" not in words or not words[words.index("--") + 1 :]:
        parser.error("a command is missing: ... -- COMMAND")
    end = words.index("--")
    arguments = parser.parse_args(words[:end])
    arguments.command = words[end + 1 :]
    return arguments


def main() -> int:
    arguments = parse_arguments(sys.argv[1:])
    try:
        return record(arguments)
    except OSError as error:
        print(f"Error: {error.filename or arguments.command[0]}: {error.strerror}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
