"""Conversion of answers to JSON: dataclasses as objects, NaN as null."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

ABSENT = MappingProxyType({"absent": True})
"""Metadata of a field without an entry where it is None."""
HIDDEN = MappingProxyType({"hidden": True})
"""Metadata of a field without an entry."""
AMONG = MappingProxyType({"among": True})
"""Metadata of a field whose own entries are merged into the object; None has none."""


def plain(value: Any) -> Any:
    """Return values for JSON: arrays as lists, NaN and infinities as None."""
    if hasattr(value, "to_dict"):
        return plain(value.to_dict())
    if is_dataclass(value) and not isinstance(value, type):
        return entries(value)
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, (str, bool, int)) or value is None:
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return plain(np.asarray(value).tolist())


def entries(answer: Any) -> dict[str, Any]:
    """Return the fields of a dataclass by name, as values for JSON."""
    found: dict[str, Any] = {}
    for field in fields(answer):
        if field.metadata.get("hidden"):
            continue
        value = getattr(answer, field.name)
        if field.metadata.get("among"):
            found |= plain(value) or {}
        elif value is not None or not field.metadata.get("absent"):
            found[field.name] = plain(value)
    return found
