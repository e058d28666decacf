"""One spelling for whatever a result was computed from, and the key that is made of it."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import os
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["canonical", "code_identity", "key_of"]


def canonical(value: Any) -> Any:
    """The value as JSON holds it: equal values alike, others different, the same in every process. A path is the file
    that it leads to, however it is spelled.

    `TypeError` for what has no such spelling, as a function.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, Enum):
        return {"enum": [type(value).__name__, value.name]}
    if isinstance(value, np.generic):
        return canonical(value.item())
    if isinstance(value, int):
        return value
    if isinstance(value, float):
        return {"float": value.hex()}
    if isinstance(value, bytes):
        return {"bytes": hashlib.sha256(value).hexdigest()}
    if isinstance(value, Path):
        return {"path": os.path.realpath(value)}
    if isinstance(value, np.ndarray):
        content = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        return {"array": [value.dtype.str, list(value.shape), content]}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = [field.name for field in dataclasses.fields(value) if field.compare]
        return {"data": [type(value).__qualname__, {name: canonical(getattr(value, name)) for name in fields}]}
    if isinstance(value, Mapping):
        pairs = [[canonical(name), canonical(one)] for name, one in value.items()]
        return {"map": sorted(pairs, key=lambda pair: json.dumps(pair[0], sort_keys=True))}
    if isinstance(value, set | frozenset):
        return {"set": sorted((canonical(one) for one in value), key=lambda one: json.dumps(one, sort_keys=True))}
    if isinstance(value, list | tuple):
        return [canonical(one) for one in value]
    raise TypeError(f"{type(value).__name__} has no spelling that is the same everywhere")


@functools.cache
def code_identity() -> dict[str, str]:
    """What of this program and this machine a result depends on: source, arithmetic, versions; by name."""
    from lidarcheck.workers.identity import arithmetic, source_of_results, versions

    return {"source": source_of_results(), "arithmetic": arithmetic(), **versions()}


def key_of(name: str, version: int, part: Any) -> str:
    """The key of a result: SHA-256 over its node's name and version, its part of the inputs, and `code_identity`."""
    spelled = json.dumps([name, version, canonical(part), code_identity()], sort_keys=True)
    return hashlib.sha256(spelled.encode()).hexdigest()
