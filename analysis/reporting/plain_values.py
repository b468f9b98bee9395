"""Data objects as values that JSON can hold, and JSON as files."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel


def plain(value: Any) -> Any:
    """Mappings, lists, strings, numbers, truth values and null only.

    An object with ``to_dict`` becomes what that says, another dataclass a mapping
    of its fields, those that begin with an underscore left out. A complex number
    becomes [re, im]; what is not finite becomes null, since JSON has no word for
    it.

    Raises:
        TypeError: There is no plain form of it.
    """
    if hasattr(value, "to_dict"):
        value = value.to_dict()
    elif is_dataclass(value) and not isinstance(value, type):
        shown = (f.name for f in fields(value) if not f.name.startswith("_"))
        value = {name: getattr(value, name) for name in shown}
    elif isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return _leaf(value)


def _leaf(value: Any) -> Any:
    if value is None or isinstance(value, str | int):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, complex):
        return [_leaf(value.real), _leaf(value.imag)]
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, Enum | Path):
        return str(value)
    raise TypeError(
        f"{type(value).__name__} has no plain form; pass its numbers instead"
    )


def write_json(document: Any, path: Path) -> None:
    """Writes a document for people and programs to read.

    Args:
        document: Plain values.
        path: The file.

    Raises:
        ValueError: A number is not finite.
    """
    text = json.dumps(document, indent=2, allow_nan=False)
    path.write_text(f"{text}\n", "utf-8")
