"""The catalogue of data sets, and the record of checksums beside the data: read, and used as datasets/fetch uses them.

Whatever a file holds, it is refused with a ConfigError that names it, or can be used.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path

from sgf_paper import fetch, paths
from sgf_paper.catalog import Catalog, load_catalog, needed_by
from sgf_paper.download import Patience
from sgf_paper.strict_yaml import ConfigError

FOLDER = tempfile.TemporaryDirectory(prefix="sgf_fuzz_")  # removed at the end of the process
paths.EXPERIMENTS = Path(FOLDER.name)
(paths.EXPERIMENTS / "experiment.yaml").write_text("sequences: {a: {folder: us/a}, middlebury2014_q: {}}\n")


def use(catalog: Catalog) -> None:
    """All that fetch does before it touches the network."""
    names = catalog.expand([*catalog.groups, *catalog.datasets])
    needed_by(["experiment"], catalog)
    fetcher = fetch.Fetcher(catalog, Path(FOLDER.name), Patience())
    with contextlib.redirect_stdout(io.StringIO()):
        fetch.list_datasets(catalog, [])
        fetch.list_datasets(catalog, names)
        print("\n".join(fetch.licence_lines(catalog, names)), fetcher.needed_bytes(names))
        for name in names:
            print(fetcher.is_there(name), fetcher.is_by_hand(name), fetch.hand_line(catalog.datasets[name], fetcher))


def fuzz(data: bytes) -> None:
    """Raises what is a finding."""
    file = Path(FOLDER.name) / "input.yaml"
    file.write_bytes(data)
    with contextlib.suppress(ConfigError):
        use(load_catalog(file))
    with contextlib.suppress(ConfigError, fetch.FetchError):
        fetch.Records(file).check("a.zip", "0" * 64)
