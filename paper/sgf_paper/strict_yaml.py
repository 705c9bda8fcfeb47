"""YAML files read strictly: a text that is none, one that would fill the memory, an unknown or a missing key, or a value
of another type is a ConfigError that names file and key.
"""

from __future__ import annotations

import functools
import itertools
import math
import reprlib
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, Callable, get_args, get_origin, get_type_hints

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


_kinds_of = functools.cache(get_type_hints)


def _is_of(kind: Any, value: Any) -> bool:
    """Whether a value of a YAML file is of a type, and what it holds too. True is no number."""
    outer, inner = get_origin(kind), get_args(kind)
    if outer is list:
        return isinstance(value, list) and all(_is_of(inner[0], item) for item in value)
    if outer is dict:
        return isinstance(value, dict) and all(all(map(_is_of, inner, item)) for item in value.items())
    return kind is Any or type(value) is kind


def require(kind: Any, value: Any, where: str) -> None:
    """@throws ConfigError for a value that is not of a type."""
    if not _is_of(kind, value):
        name = str(kind) if get_origin(kind) else kind.__name__
        raise ConfigError(f"{where}: expected {name.replace('typing.', '')}, found {reprlib.repr(value)}")


def build(cls: type, node: Any, where: str) -> Any:
    """Makes dataclass `cls` of a YAML map whose keys must be exactly its fields."""
    if not isinstance(node, dict):
        raise ConfigError(f"{where}: expected a map, found {reprlib.repr(node)}")
    known = {f.name: f for f in fields(cls)}
    for key in node:
        if key not in known:
            raise ConfigError(f"{where}: unknown key '{key}'; known: {', '.join(known)}")
    for name, f in known.items():
        if name not in node and f.default is MISSING and f.default_factory is MISSING:
            raise ConfigError(f"{where}: key '{name}' is missing")
    return cls(**node)


def build_typed(cls: type, node: Any, where: str) -> Any:
    """As build(), and values have to be of their fields' types."""
    built = build(cls, node, where)
    for name, kind in _kinds_of(cls).items():
        require(kind, getattr(built, name), f"{where}.{name}")
    return built


def build_each(
    cls: type, nodes: Any, where: str, by: Callable[[type, Any, str], Any] = build
) -> dict[str, Any]:
    """Makes dataclass `cls` of each of some named YAML maps, by build() or build_typed()."""
    require(dict[str, Any], nodes, where)
    return {name: by(cls, node, f"{where}.{name}") for name, node in nodes.items()}


def build_list(cls: type, nodes: list[dict[str, Any]], where: str) -> list[Any]:
    """Makes dataclass `cls` of each of some YAML maps."""
    return [build(cls, node, where) for node in nodes]
