"""Downloads a file with aria2, which resumes and takes several connections.

aria2 makes one attempt at a time; what it said decides here whether another follows. What has arrived lies in
NAME.part, and NAME.part.aria2 says which of it: without the second the first is worth nothing. NAME appears when
all is there.
"""

from __future__ import annotations

import glob
import os
import re
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

# aria2's exit codes that another attempt does not mend: not found, disk full, cannot be written, login asked for.
FINAL = {3, 9, 15, 16, 17, 18, 24}
FINAL_STATUS = {400, 401, 403, 404, 410}  # of HTTP
UNKNOWN_HOST = 19  # of aria2: final where nothing has arrived yet
NO_RESUME = {8, 10, 22}  # of aria2: may come from what has arrived: no ranges, status 416
USER_AGENT = "sgf-fetch/1"


class DownloadError(Exception):
    """Why an address did not give its file."""


@dataclass(frozen=True)
class Patience:
    """How long an address may take."""

    connections: int = 4  # at most 16, as aria2 allows for one server
    timeout_s: int = 60  # without a byte
    attempts: int = 6  # in a row that bring nothing new
    pause_s: float = 5  # after the first of them; doubles
    report_s: float = 30  # between lines on the progress


@dataclass(frozen=True)
class Outcome:
    """What an attempt came to."""

    code: int  # 0: all is there
    status: int  # of HTTP, where it was the reason; else 0
    text: str

    @property
    def is_final(self) -> bool:
        return self.code in FINAL or self.status in FINAL_STATUS

    @property
    def blames_the_partial_file(self) -> bool:
        refused = self.code in NO_RESUME and self.status in (0, 416)
        return refused or self.code < 0 or "length mismatch" in self.text


def _control(part: Path) -> Path:
    return part.with_name(f"{part.name}.aria2")


def drop(part: Path) -> None:
    """Forgets what has arrived."""
    for file in part.parent.glob(f"{glob.escape(part.name)}*"):
        file.unlink()


def arrived(part: Path) -> int:
    """Bytes of a partial file that have arrived, about: what is not there yet takes no blocks."""
    return 512 * part.stat().st_blocks if part.exists() else 0


def _command(url: str, part: Path, patience: Patience) -> list[str]:
    return [
        "aria2c", "--no-conf", "--no-netrc", f"--user-agent={USER_AGENT}",
        f"--dir={part.parent}", f"--out={part.name}", "--allow-overwrite=true", "--auto-file-renaming=false",
        "--continue", "--always-resume=false", "--max-resume-failure-tries=0", "--auto-save-interval=1",
        f"--split={patience.connections}", f"--max-connection-per-server={patience.connections}",
        "--min-split-size=1M", "--file-allocation=none",
        "--max-tries=1", f"--timeout={patience.timeout_s}", f"--connect-timeout={patience.timeout_s}",
        "--disk-cache=0", "--follow-torrent=false", "--follow-metalink=false",
        f"--stop-with-process={os.getpid()}", "--console-log-level=warn", "--summary-interval=0",
        "--download-result=hide", "--show-console-readout=false", "--enable-color=false", url,
    ]  # fmt: skip


def _outcome(code: int, log: str) -> Outcome:
    statuses = re.findall(r"status=(\d+)", log)
    reasons = re.findall(r"errorCode=\d+ (?!URI=)(.+)", log)
    if code == 3 and not statuses:
        statuses = ["404"]
    if statuses:
        return Outcome(code, int(statuses[-1]), f"the server answers {statuses[-1]}")
    return Outcome(code, 0, reasons[-1].strip() if reasons else f"aria2c ends with code {code}")


def _wait(child: subprocess.Popen[bytes], part: Path, patience: Patience, report: Callable[[int], None]) -> None:
    """Waits for aria2's end and reports what has arrived; ends it if we are interrupted."""
    try:
        while child.poll() is None:
            try:
                child.wait(patience.report_s)
            except subprocess.TimeoutExpired:
                report(arrived(part))
    finally:
        child.terminate()
        child.wait()


def _attempt(url: str, part: Path, patience: Patience, report: Callable[[int], None], lock: int) -> Outcome:
    log = part.with_name(f"{part.name}.log")
    with log.open("w") as out:
        try:
            child = subprocess.Popen(
                _command(url, part, patience),
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                pass_fds=[lock],
            )
        except FileNotFoundError as error:
            raise DownloadError("aria2c is not installed (Debian package aria2)") from error
        _wait(child, part, patience, report)
    outcome = _outcome(child.returncode, log.read_text(errors="replace"))
    log.unlink()
    return outcome


def download(url: str, file: Path, patience: Patience, report: Callable[[int], None], lock: int) -> None:
    """Downloads a file, going on from what an earlier call left.

    An attempt that brings nothing new is repeated after a pause, and the next pause is twice as long.

    @param report told how many bytes are there, now and then.
    @param lock open file that aria2 holds as well: who takes it knows that nobody writes the file.
    @throws DownloadError if the address does not give the file; what has arrived stays.
    """
    part = file.with_name(f"{file.name}.part")
    if not _control(part).exists():
        drop(part)
    most, idle = arrived(part), 0
    while True:
        had = arrived(part)
        outcome = _attempt(url, part, patience, report, lock)
        if outcome.code == 0:
            part.rename(file)
            return
        if outcome.blames_the_partial_file and had:
            drop(part)
        idle = 0 if arrived(part) > most else idle + 1
        most = max(most, arrived(part))
        hopeless = outcome.is_final or (outcome.code == UNKNOWN_HOST and not most)
        if hopeless or idle >= patience.attempts:
            raise DownloadError(outcome.text)
        time.sleep(patience.pause_s * 2 ** max(idle - 1, 0))
