"""What a run made, where it lies and what it measured, in a few lines."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from sgf_paper import bench, catalog, config, repeated_runs, text
from sgf_paper.catalog import Source
from sgf_paper.config import KINDS
from sgf_paper.experiment import Experiment
from sgf_paper.stereo_datasets import Dataset


EARLIER = "what is shown is of an earlier run"


def read_reasons(listing: Path) -> dict[str, str]:
    """Why experiments were not made when they were last asked for, from lines `name<TAB>reason`."""
    if not listing.exists():
        return {}
    return dict(line.split("\t", 1) for line in listing.read_text().splitlines() if line)


def main_file(stage: Experiment, results: Path) -> Path:
    """The file whose presence and time say whether and when a stage was made."""
    return results / KINDS[stage.kind].main_file.format(name=stage.name)


def _files(stage: Experiment) -> str:
    """What a stage makes: of figures and of tables a name, and how the others end."""
    kind = KINDS[stage.kind]
    texts = [kind.others.format(name=stage.name, folder=getattr(stage, "folder", ""))] if kind.others else []
    tables = sorted(kind.tables, key=lambda end: end != ".md")  # that is made to be read
    for folder, ends in (("figures", kind.figures), ("tables", tables)):
        if ends:
            others = f" ({', '.join(ends[1:])})" if ends[1:] else ""
            texts.append(f"{folder}/{stage.name}{ends[0]}{others}")
    return ", ".join(texts)


def _table_lines(path: Path) -> list[str]:
    """Per data set, region and matcher the paper's columns by mean error."""
    frame = pd.read_csv(path)
    main = config.load_experiment(path.stem).sweeps[0].main_columns
    measured = frame[frame["measured"].notna() & frame["cost"].isin(main)]
    lines = []
    keys = ["dataset", "region", "matcher"]
    for (dataset, region, matcher), block in measured.groupby(keys, sort=False):
        wide = block.pivot(index="cost", columns="quantity", values="measured")
        order = wide.sort_values("mean_px")
        scenes = block["scenes"].max()
        of = block[block["quantity"] == "mean_px"].set_index("cost")["scenes"]
        texts = [
            f"{cost} {row.mean_px:.2f}" + (f" ({of[cost]} of {scenes})" if of[cost] < scenes else "")
            for cost, row in order.iterrows()
        ]
        best = order.iloc[0]
        lines.append(
            f"{dataset} {region}, {scenes} scenes, {text.matcher_title(matcher)},"
            f" mean px: {', '.join(texts)};"
            f" {order.index[0]}: bad 2 {best.bad2_pct:.1f} %, invalid {best.invalid_pct:.1f} %"
        )
    return lines


def _bench_lines(path: Path) -> list[str]:
    speeds = pd.read_csv(path)
    lines = [
        f"{row.case}: {row.implementation} {row.ratio:.2f} times {row.peer} ({row.isa}, 1 thread)"
        for row in bench.ratios_to_opencv(speeds).itertuples()
    ]
    scaling = bench.scaling(speeds)
    lines += [
        f"{row.case}: {row.implementation} on {row.threads} threads {row.ratio:.2f} times 1 thread"
        f" ({row.isa})"
        for row in scaling[scaling["implementation"].isin(bench.PEERS)].itertuples()
    ]
    return lines


def _semi_dense_lines(path: Path, drawn: list[str]) -> list[str]:
    """Per case, the drawn columns' points kept and how far off these are."""
    scores = pd.read_csv(path)
    lines = []
    for case, rows in scores[scores["column"].isin(drawn)].groupby("case", sort=False):
        texts = [
            f"{row.column} {row.kept_pct:.0f} %, {100 * row.median_m:.1f} / {100 * row.p90_m:.1f} cm"
            for row in rows.itertuples()
        ]
        lines.append(f"{case}, kept, median / 90th percentile of depth errors: {'; '.join(texts)}")
    return lines


def _self_match_lines(path: Path) -> list[str]:
    """Per group and case, the paper's columns by mean error over the frames, first range."""
    frame = pd.read_csv(path)
    first = frame[(frame["first_disparity"] == frame["first_disparity"].iloc[0]) & ~frame["extra"]]
    lines = []
    for (group, case), rows in first.groupby(["group", "case"], sort=False):
        means = rows.groupby("cost")["mean_px"].mean().sort_values()
        texts = [f"{cost} {mean:.2f}" for cost, mean in means.items()]
        lines.append(f"{group} {case}, mean px: {', '.join(texts)}")
    return lines


def _convergence_lines(path: Path, start_px: float) -> list[str]:
    """Per case the compared columns by the share of tracks that converge from one start."""
    frame = pd.read_csv(path)
    shown = frame[(frame["unit"] == "px") & (frame["start"] == start_px) & frame["compared"]]
    lines = []
    for case, rows in shown.groupby("case", sort=False):
        order = rows.sort_values("converged_pct", ascending=False, kind="stable")
        texts = [f"{row.column} {row.converged_pct:.0f}" for row in order.itertuples()]
        lines.append(f"{case}, converged from {start_px:g} px, %: {', '.join(texts)}")
    return lines


def _mrpt_map_lines(path: Path) -> list[str]:
    """Per sequence the counts and the error."""
    return [
        f"{row.sequence}: {row.posed} of {row.frames} frames with pose, {row.keyframes} key-frames,"
        f" {row.points} points, ATE RMSE {1000 * row.ate_rmse_m:.1f} mm"
        for row in pd.read_csv(path).itertuples()
    ]


def _direct_map_lines(path: Path) -> list[str]:
    """Per sequence and column the error of the path, and where the surface is known that of the points."""
    lines = []
    for sequence, rows in pd.read_csv(path).groupby("sequence", sort=False):
        known = rows["median_m"].notna().any()
        texts = [
            f"{row.column} {1000 * row.ate_rmse_m:.1f} mm"
            + (f", {100 * row.median_m:.1f} cm, {100 * row.spread_m:.1f} cm" if known else "")
            for row in rows.itertuples()
        ]
        what = ", ATE RMSE" + (", median off the surface, spread of walls" if known else "")
        lines.append(f"{sequence}{what}: {'; '.join(texts)}")
    return lines


def _light_change_lines(path: Path) -> list[str]:
    """Per data set, region, case and matcher the columns by the rise of their mean error."""
    frame = pd.read_csv(path, dtype={"case": str}).dropna(subset="mean_px_rise")
    lines = []
    keys = ["dataset", "region", "case", "matcher"]
    for (dataset, region, case, matcher), rows in frame.groupby(keys, sort=False):
        order = rows.sort_values("mean_px_rise")
        texts = [f"{row.cost} {row.mean_px_rise:+.2f}" for row in order.itertuples()]
        where = f"{dataset} {region}, {case}, {text.matcher_title(matcher)}"
        lines.append(f"{where}, rise of mean px: {', '.join(texts)}")
    return lines


def _odometry_lines(path: Path, counted: str = "lost") -> list[str]:
    """Per sequence and condition the columns by their ATE, and how many runs were lost, or else `counted`."""
    frame = pd.read_csv(path)
    lines = []
    for (sequence, condition), rows in frame.groupby(["sequence", "condition"], sort=False):
        order = rows.sort_values("ate_mm", kind="stable")
        texts = [
            f"{row.column} {row.ate_mm:.1f}"
            + (f" ({count}/{row.runs} {counted})" if (count := getattr(row, counted)) else "")
            for row in order.itertuples()
        ]
        lines.append(f"{sequence}, {condition}, median ATE mm: {', '.join(texts)}")
    return lines


def _trajectory_table_lines(path: Path, verdict_runs: int) -> list[str]:
    """Where runs are enough, comparisons over all sequences together; then the errors of each."""
    runs = pd.read_csv(path)["runs"].max()
    if runs < verdict_runs:
        return [
            f"runs of each line: {runs}; comparisons take {verdict_runs} (tables/{path.stem}.md has what these say)",
            *_odometry_lines(path, "failed"),
        ]
    compared = pd.read_csv(path.with_name(f"{path.stem}_compared.csv"))
    lines = [
        f"{row.condition}, success by {row.rule} rule, {row.pairs} pairs of runs:"
        f" {row.column} {row.both + row.only_own}, {row.baseline} {row.both + row.only_baseline},"
        f" difference {row.difference_pct:+.0f} [{row.low_pct:+.0f}, {row.high_pct:+.0f}] %, p = {row.p:.2g}"
        for row in compared.itertuples()
    ]
    errors = pd.read_csv(path.with_name(f"{path.stem}_ate_compared.csv"))
    lines += [
        f"{row.condition}, ATE of {row.column} over that of {row.baseline}, {row.pairs} pairs of runs:"
        f" {text.format_estimate(row.ratio, row.ratio_low, row.ratio_high, 2)}, {row.verdict}"
        for row in errors[errors["sequence"] == repeated_runs.ALL].itertuples()
    ]
    return lines + _odometry_lines(path, "failed")


def _joined_table_lines(path: Path) -> list[str]:
    """Per data set the systems by their measured ATE, the mean over its sequences, as far as all have one."""
    frame = pd.read_csv(path)
    lines = []
    measured = frame[(frame["quantity"] == "ate_mean_m") & (frame["runs"] > 0)]
    for dataset, rows in measured.groupby("dataset", sort=False):
        wide = rows.pivot(index="system", columns="sequence", values="measured")
        means = 1000 * wide.mean(axis=1, skipna=False).dropna().sort_values(kind="stable")
        texts = [f"{system} {mean:.1f}" for system, mean in means.items()]
        lines.append(f"{dataset}, sequences: {wide.shape[1]}, mean ATE mm: {', '.join(texts)}")
    return lines


def _tuning_lines(path: Path) -> list[str]:
    """Per column and fold the error on the sequences that had no part in the tuning."""
    return [
        f"{row.column} tuned on {row.trained_on}, error elsewhere, % of the path:"
        f" {row.held_out_tuned_pct:.2f}, by default {row.held_out_default_pct:.2f};"
        f" ratio {text.format_estimate(row.ratio, row.ratio_low, row.ratio_high, 2)}"
        for row in pd.read_csv(path).itertuples()
    ]


def _counted(words: pd.Series) -> str:
    return ", ".join(f"{word} {count}" for word, count in words.value_counts(sort=False).items())


def _report_lines(page: Path) -> list[str]:
    """Statements by their verdicts, the paper's values by their marks, and whether there is a PDF."""
    tables = page.parent / "tables"
    verdicts, values = (pd.read_csv(tables / f"{page.stem}_{end}.csv") for end in ("verdicts", "values"))
    lines = [f"{chapter}: {_counted(own['verdict'])}" for chapter, own in verdicts.groupby("chapter", sort=False)]
    lines.append(f"values of the paper: {_counted(values['mark'].replace('–', 'not compared'))}")
    return lines + ([] if page.with_suffix(".pdf").exists() else ["no PDF: latexmk is not installed"])


def _measured(stage: Experiment, results: Path) -> list[str]:
    if stage.kind == "table":
        return _table_lines(main_file(stage, results))
    if stage.kind == "light_change":
        return _light_change_lines(main_file(stage, results))
    if stage.kind == "benchmark":
        return _bench_lines(main_file(stage, results))
    if stage.kind == "semi_dense":
        return _semi_dense_lines(main_file(stage, results), stage.drawn)
    if stage.kind == "convergence":
        return _convergence_lines(main_file(stage, results), stage.table_start["px"])
    if stage.kind == "direct_map":
        return _direct_map_lines(main_file(stage, results))
    if stage.kind == "joined_table":
        return _joined_table_lines(main_file(stage, results))
    if stage.kind == "mrpt_map":
        return _mrpt_map_lines(main_file(stage, results))
    if stage.kind == "odometry":
        return _odometry_lines(main_file(stage, results))
    if stage.kind == "report":
        return _report_lines(main_file(stage, results))
    if stage.kind == "self_match":
        return _self_match_lines(main_file(stage, results))
    if stage.kind == "trajectory_table":
        return _trajectory_table_lines(main_file(stage, results), stage.verdict_runs)
    if stage.kind == "tuning":
        return _tuning_lines(main_file(stage, results))
    return []


def stage_lines(stage: Experiment, results: Path, started: float, failed: bool = False) -> list[str]:
    """Lines on one stage; `started` is when the run began, in seconds of the epoch."""
    path = main_file(stage, results)
    if not path.exists():
        return [f"  {stage.name:14} NOT MADE"]
    state = "made" if path.stat().st_mtime >= started else "up to date"
    if failed:
        state = f"FAILED; {EARLIER}:"
    head = f"  {stage.name:14} {state:11} {_files(stage)}"
    return [head, *(f"    {line}" for line in _measured(stage, results))]


def _where_to_get(name: str, source: Source) -> str:
    """A data set's home, and how to have it fetched or what to do."""
    return f"{source.publisher.home}; {source.by_hand or f'datasets/fetch {name} --into DIR'}"


def absent_datasets(stages: list[Experiment], datasets: dict[str, Dataset]) -> list[str]:
    """Data sets that the stages would use and that were not found, each with where to get it."""
    wanted = []
    for stage in stages:
        if stage.kind == "table":
            wanted += stage.datasets
    known = catalog.load_catalog().datasets
    missing = [name for name in dict.fromkeys(wanted) if name not in datasets]
    return [f"{name} ({_where_to_get(name, known[name])})" for name in missing]
