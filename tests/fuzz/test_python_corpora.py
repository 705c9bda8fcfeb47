"""Feeds the corpora of the fuzzers that are written in Python to them, without libFuzzer: see embed_python.cc."""

import importlib
from pathlib import Path

import pytest

HERE = Path(__file__).parent
FUZZERS = [path.stem for path in HERE.glob("*_fuzzer.py")]
INPUTS = [(name, file) for name in FUZZERS for file in (HERE / "corpus" / name.removesuffix("_fuzzer")).iterdir()]


@pytest.mark.parametrize("name, file", INPUTS, ids=[f"{name}-{file.name}" for name, file in INPUTS])
def test_it_is_loaded_or_refused(name, file):
    importlib.import_module(name).fuzz(file.read_bytes())
