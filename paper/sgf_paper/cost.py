"""What the runs in a results folder have taken, as a table in Markdown: one line a kind of job, that of most time first.

Time is that of processors, which does not depend on what else the machine did; memory is the largest run's.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from pathlib import Path
from statistics import mean

from sgf_paper import paths

HEADER = "| job | runs | CPU s, mean | CPU s, most | CPU h, all | peak MiB |\n|---|---|---|---|---|---|\n"


def kind_of(run: dict) -> str:
    """Its rule and, if it made raw results, the sweep or experiment that they are of."""
    folders = Path(next(iter(run["outputs"]), "")).parent.parts
    return f"`{run['rule']}` {folders[1]}" if folders[:1] == ("raw",) and len(folders) > 1 else f"`{run['rule']}`"


def read_timings(results: Path) -> dict[str, list[dict]]:
    """The timings of all runs that ended well, by their kind."""
    found = defaultdict(list)
    for file in sorted(path for top in ("raw", "runs") for path in (results / top).rglob("timing.json")):
        node = json.loads(file.with_name("run.json").read_text())
        if node["exit"]["state"] == "done":
            found[kind_of(node)].append(json.loads(file.read_text()))
    return found


def cost_table(results: Path) -> str:
    lines = []
    for kind, timings in read_timings(results).items():
        cpu, peak = [t["cpu_s"] for t in timings], max(t["peak_mib"] for t in timings)
        numbers = f"{len(cpu)} | {mean(cpu):.1f} | {max(cpu):.1f} | {sum(cpu) / 3600:.3f} | {peak:.0f}"
        lines.append((-sum(cpu), f"| {kind} | {numbers} |\n"))
    return HEADER + "".join(line for _, line in sorted(lines))


def main() -> None:
    parser = argparse.ArgumentParser(prog="sgf_paper.cost", description=__doc__)
    parser.add_argument("--results", type=Path, default=paths.PROJECT / "results")
    print(cost_table(parser.parse_args().results), end="")


if __name__ == "__main__":
    main()
