"""Progress lines for Snakemake (its --log-handler-script): count, time passed and time left.

Snakemake calls log_handler() with every message; its own text goes to a log file.
"""

from __future__ import annotations

import re
import time
from collections import Counter, defaultdict
from pathlib import Path

TAIL_LINES = 15


def clock(seconds: float) -> str:
    """Seconds as m:ss or h:mm:ss."""
    minutes, rest = divmod(int(round(seconds)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


class Progress:
    """Follows the jobs of one run.

    The time left is the work left, each job taken to last as long as the finished ones of its rule
    did, at the pace kept so far.
    """

    def __init__(self) -> None:
        self.start = time.time()
        self.left: Counter[str] = Counter()  # jobs not finished, by rule
        self.total = 0
        self.failed = False
        self.running: dict[int, tuple[str, str, float]] = {}  # rule, label, start by job id
        self.durations: dict[str, list[float]] = defaultdict(list)

    def handle(self, message: dict) -> None:
        """Takes one message of Snakemake."""
        level = message["level"]
        if level == "run_info":
            self._plan(message["msg"])
        elif level == "job_info":
            self.running[message["jobid"]] = (message["name"], message["msg"], time.time())
        elif level == "job_finished":
            self._finish(message["jobid"])
        elif level == "job_error":
            self._fail(message)
        elif level == "error" and not self.failed:
            print(f"  {message['msg']}", flush=True)

    def _plan(self, stats: str) -> None:
        """Reads the counts from Snakemake's table of jobs: lines `rule count ...`."""
        for rule, count in re.findall(r"^(\w+)\s+(\d+)\b", stats, re.MULTILINE):
            if rule not in ("all", "total"):
                self.left[rule] = int(count)
        self.total = sum(self.left.values())

    def _finish(self, job: int) -> None:
        rule, label, start = self.running.pop(job)
        if rule == "all":
            return
        now = time.time()
        self.durations[rule].append(now - start)
        self.left[rule] -= 1
        done = self.total - sum(self.left.values())
        width = len(str(self.total))
        text = f"  [{done:{width}}/{self.total}] {label:44} {clock(now - start):>7}"
        print(f"{text}   elapsed {clock(now - self.start)}{self._time_left(now)}", flush=True)

    def _time_left(self, now: float) -> str:
        every = [duration for durations in self.durations.values() for duration in durations]
        mean = sum(every) / len(every)
        work = 0.0
        for rule, count in self.left.items():
            own = self.durations.get(rule)
            work += count * (sum(own) / len(own) if own else mean)
        if not work:
            return ""
        return f", about {clock(work * (now - self.start) / max(sum(every), 1e-3))} left"

    def _fail(self, message: dict) -> None:
        self.failed = True
        self.running.pop(message["jobid"], None)
        log = Path(message["log"][0]) if message["log"] else None
        where = f"; log: {log.resolve()}" if log else ""
        print(f"  FAILED {message['name']}: {' '.join(message['output'][:1])}{where}", flush=True)
        if log and log.exists():
            for line in log.read_text(errors="replace").splitlines()[-TAIL_LINES:]:
                print(f"    | {line}", flush=True)


_progress = Progress()


def log_handler(message: dict) -> None:
    """Entry point for Snakemake."""
    _progress.handle(message)
