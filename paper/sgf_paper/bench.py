"""Throughput of stereo matching from the JSON report of Google Benchmark.

Benchmarks are named case/implementation/isa/threads and count mde_per_s (10^6 disparities evaluated
a second: width * height * disparities / 10^6 / time) and peak_mib (memory).
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import pandas as pd

from sgf_paper import config, text

KEYS = ["case", "implementation", "isa", "threads"]
VALUES = ["mde_per_s", "peak_mib"]
# Ours and the peer that it stands against, with what the peer is called.
PEERS = {
    "sgf_bm": ("opencv_bm", "cv::StereoBM"),
    "sgf_sgm": ("opencv_sgbm", "cv::StereoSGBM"),
}


class BenchError(Exception):
    """A report that is not what it must be."""


def read_report(path: Path) -> pd.DataFrame:
    """Median over the repetitions of each benchmark, in the program's order (runs come shuffled)."""
    rows = []
    runs = json.loads(path.read_text())["benchmarks"]
    for run in sorted(runs, key=lambda run: run["family_index"]):
        if run.get("run_type") == "aggregate":
            continue
        if run.get("error_occurred"):
            raise BenchError(f"{path}: {run['name']} failed: {run.get('error_message')}")
        case, implementation, isa, threads = run["run_name"].split("/")[:4]
        rows.append((case, implementation, isa, int(threads), *(run[v] for v in VALUES)))
    if not rows:
        raise BenchError(f"{path}: no benchmark was run")
    frame = pd.DataFrame(rows, columns=[*KEYS, *VALUES])
    return frame.groupby(KEYS, sort=False)[VALUES].median().reset_index()


def _one_thread_peer(speeds: pd.DataFrame, case: str, peer: str, isa: str) -> float:
    """OpenCV's matcher on one thread: on the same instruction set, else its fastest."""
    opencv = speeds[
        (speeds["case"] == case) & (speeds["implementation"] == peer) & (speeds["threads"] == 1)
    ]
    same = opencv[opencv["isa"] == isa]
    return (opencv if same.empty else same)["mde_per_s"].max()


def ratios_to_opencv(speeds: pd.DataFrame) -> pd.DataFrame:
    """Throughput of our matchers over their peers', both on one thread, by case and instruction set."""
    rows = []
    one_thread = speeds[speeds["implementation"].isin(PEERS) & (speeds["threads"] == 1)]
    for row in one_thread.itertuples():
        peer, title = PEERS[row.implementation]
        opencv = _one_thread_peer(speeds, row.case, peer, row.isa)
        ratio = row.mde_per_s / opencv
        rows.append((row.case, row.implementation, row.isa, row.mde_per_s, title, opencv, ratio))
    columns = ["case", "implementation", "isa", "sgf", "peer", "opencv", "ratio"]
    return pd.DataFrame(rows, columns=columns)


def scaling(speeds: pd.DataFrame) -> pd.DataFrame:
    """Throughput on several threads over that on one, for everything that was run on both."""
    one = speeds[speeds["threads"] == 1]
    many = speeds[speeds["threads"] > 1]
    both = many.merge(one, on=["case", "implementation", "isa"], suffixes=("", "_one"))
    both["ratio"] = both["mde_per_s"] / both["mde_per_s_one"]
    return both[[*KEYS, "ratio"]]


def make_bench(name: str, report: Path, out: Path) -> None:
    """Writes <name>.csv and <name>.md."""
    experiment = config.load_experiment(name)
    speeds = read_report(report)
    text.write_csv(speeds, out / f"{name}.csv")
    document = text.render(
        "bench.md.j2",
        experiment=experiment,
        context=json.loads(report.read_text())["context"],
        speeds=speeds.to_dict("records"),
        ratios=ratios_to_opencv(speeds).to_dict("records"),
        scaling=scaling(speeds).to_dict("records"),
    )
    (out / f"{name}.md").write_text(document)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="experiment of paper/experiments")
    parser.add_argument("--report", type=Path, required=True, help="JSON of Google Benchmark")
    parser.add_argument("--out", type=Path, required=True, help="folder for CSV and Markdown")
    a = parser.parse_args()
    make_bench(a.name, a.report, a.out)


if __name__ == "__main__":
    main()
