"""YAML files read strictly as typed objects.

A text that is none, one that would fill the memory, an unknown or a missing key, or a value of another type is a
ConfigError that names file and key.
"""

from __future__ import annotations

import functools
import itertools
import math
import reprlib
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import yaml

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same, and faster where PyYAML has it
# What PyYAML raises over a text, and over a value that is none of its type, such as a 45th of May.
NOT_YAML = (yaml.YAMLError, ValueError, ArithmeticError, LookupError, AttributeError, TypeError)
DEEPEST = 50  # lists and maps in each other
LARGEST = 1_000_000  # values


class ConfigError(Exception):
    """What is wrong in a file of settings; the text names file and key."""


def _require_shallow(text: str, path: Path) -> None:
    """@throws ConfigError for lists in lists in lists, over which the readers end by their stack."""
    depth = 0
    for event in yaml.parse(text, Loader=LOADER):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise ConfigError(f"{path}: line {event.start_mark.line + 1}: nested more than {DEEPEST} deep")


def _written_out(node: yaml.Node, sizes: dict[int, float]) -> float:
    """Nodes that a node makes, aliases written out; infinite for one that holds itself."""
    if id(node) not in sizes:
        sizes[id(node)] = math.inf
        children = [] if isinstance(node, yaml.ScalarNode) else node.value
        if isinstance(node, yaml.MappingNode):
            children = itertools.chain.from_iterable(children)
        sizes[id(node)] = 1 + sum(_written_out(child, sizes) for child in children)
    return sizes[id(node)]


def _load(text: str, path: Path) -> Any:
    """What a YAML text holds, of which a few lines can make more than there is memory for."""
    _require_shallow(text, path)
    loader = LOADER(text)
    try:
        root = loader.get_single_node()
        if root is not None and _written_out(root, {}) > LARGEST:
            raise ConfigError(f"{path}: its aliases make more than {LARGEST} values")
        return None if root is None else loader.construct_document(root)
    finally:
        loader.dispose()


def read_yaml(path: Path) -> dict[str, Any]:
    """Reads a YAML file that holds a map."""
    try:
        node = _load(path.read_text(), path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except NOT_YAML as error:
        raise ConfigError(f"{path}: {error}") from error
    if not isinstance(node, dict):
        raise ConfigError(f"{path}: expected a map")
    return node


_kinds_of = functools.cache(functools.partial(get_type_hints, include_extras=True))


def _inside(where: str, key: Any) -> str:
    """The place of a key: `file: key`, and below that `file: key.key`."""
    return f"{where}.{key}" if ": " in where else f"{where}: {key}"


def _build_fields(cls: type, node: dict[str, Any], where: str) -> Any:
    """Makes a dataclass of a map whose keys must be exactly its fields."""
    known = {f.name: f for f in fields(cls)}
    for key in node:
        if key not in known:
            raise ConfigError(f"{where}: unknown key '{key}'; known: {', '.join(known)}")
    for name, f in known.items():
        if name not in node and f.default is MISSING and f.default_factory is MISSING:
            raise ConfigError(f"{where}: key '{name}' is missing")
    kinds = _kinds_of(cls)
    built = cls(**{key: build(kinds[key], value, _inside(where, key)) for key, value in node.items()})
    if hasattr(built, "check"):
        built.check(where)
    return built


def build(kind: Any, value: Any, where: str) -> Any:
    """Makes of what a YAML file holds what a type says: also what lists and maps hold, and dataclasses of maps.

    `Annotated[T, make]` says that make(value, where) makes the T. A dataclass may have a method check(where), which
    throws if its values do not fit together. A whole number is a float too; true is no number.
    @param where file and key, for errors.
    @throws ConfigError for a value of another type.
    """
    outer, inner = get_origin(kind), get_args(kind)
    if outer is Annotated:
        return inner[1](value, where)
    if outer is UnionType:  # T | None
        return None if value is None else build(inner[0], value, where)
    if outer is list and isinstance(value, list):
        return [build(inner[0], item, f"{where}[{index}]") for index, item in enumerate(value)]
    if outer is dict and isinstance(value, dict):
        return {
            build(inner[0], key, f"{where}: a key"): build(inner[1], item, _inside(where, key))
            for key, item in value.items()
        }
    if is_dataclass(kind) and isinstance(value, dict):
        return _build_fields(kind, value, where)
    if kind is Any or type(value) is kind or (kind is float and type(value) is int):
        return value
    name = "a list" if outer is list else "a map" if outer is dict or is_dataclass(kind) else kind.__name__
    raise ConfigError(f"{where}: expected {name}, found {reprlib.repr(value)}")
