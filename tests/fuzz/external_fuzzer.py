"""Trajectories of other systems, and the file beside them that says how they are scored: read as those of
results/external are.

Whatever a file holds, it is refused with an ExternalError or a ConfigError, or can be handed to sgf_eval.
"""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path

from sgf_paper import external
from sgf_paper.strict_yaml import ConfigError
from sgf_paper.tracking_config import load_external_system

FOLDER = tempfile.TemporaryDirectory(prefix="sgf_fuzz_")  # removed at the end of the process


def fuzz(data: bytes) -> None:
    """Raises what is a finding."""
    folder = Path(FOLDER.name)
    for suffix in external.SUFFIXES:
        file = folder / f"MH_01_easy{suffix}"
        file.write_bytes(data)
        with contextlib.suppress(external.ExternalError):
            external.write_tum(external.read_poses(file), folder / "estimate")
    (folder / "align.yaml").write_bytes(data)
    with contextlib.suppress(ConfigError):
        load_external_system(folder)
