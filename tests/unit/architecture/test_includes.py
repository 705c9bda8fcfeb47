"""The folders of src/ depend on one another in one direction only."""

import re
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[3]
SOURCES = sorted(p for p in (PROJECT / "src").rglob("*") if p.suffix in {".h", ".cc", ".inc"})

# What each folder may include besides itself.
ALLOWED = {
    "core": set(),
    "metrics": {"core"},
    "stereo": {"core", "metrics"},
    "io": {"core"},
    "eval": {"core"},
    "synth": {"core", "io", "eval"},
    "alignment": {"core", "metrics"},
    "odometry": {"core", "metrics", "stereo", "alignment"},
    "direct": {"core", "metrics", "alignment"},
    "flow": {"core", "metrics", "alignment"},
    "vio": {"core", "metrics", "alignment", "flow"},
    "apps": {
        "core", "metrics", "stereo", "alignment", "odometry", "direct", "flow", "vio", "io", "eval",
        "synth",
    },
}


def folder_of(path):
    return path.relative_to(PROJECT / "src").parts[0]


def includes_of(path):
    """Folders of src/ that a file includes from."""
    return re.findall(r'#\s*include\s*<sgf/(\w+)/', path.read_text())


def test_every_folder_has_its_place_in_the_order():
    assert {folder_of(path) for path in SOURCES} == set(ALLOWED)


def test_no_include_goes_the_wrong_way():
    wrong = [
        f"{path.relative_to(PROJECT)} includes from {target}"
        for path in SOURCES
        for target in includes_of(path)
        if target != folder_of(path) and target not in ALLOWED[folder_of(path)]
    ]
    assert not wrong


def test_files_of_the_project_are_included_by_their_full_path():
    quoted = [
        str(path.relative_to(PROJECT))
        for path in SOURCES
        if re.search(r'#\s*include\s*"', path.read_text())
    ]
    assert not quoted


def test_only_the_places_meant_for_them_use_mrpt_and_ceres():
    users = {
        (folder_of(path), library)
        for path in SOURCES
        for library in re.findall(r"#\s*include\s*<(mrpt|ceres)/", path.read_text())
    }
    assert users == {("direct", "ceres"), ("vio", "ceres")}
