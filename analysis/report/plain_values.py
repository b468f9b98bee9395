"""Conversion of data objects to values that JSON can represent, and JSON files."""

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
    """Converts a value to mappings, lists, texts, numbers, truth values and None.

    The entries of mappings, lists and tuples are converted, too. The function converts
    values of the types below. It raises TypeError for any other type that JSON cannot
    represent.

    - An object with a method ``to_dict`` is replaced by the result of this method.
    - Any other dataclass becomes a mapping of its fields. Fields whose names begin with
      an underscore are omitted.
    - A NumPy array becomes a list.
    - A complex number becomes [re, im].
    - An infinite number or NaN becomes None, because JSON has no such numbers.
    - A model of pydantic becomes a mapping.
    - A path or an enumeration value becomes a text.
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


def pick(value: Any, *names: str) -> dict[str, Any]:
    """Returns the attributes with these names, by name."""
    return {name: getattr(value, name) for name in names}


def write_json(document: Any, path: Path) -> None:
    """Writes plain values as indented JSON; raises ValueError for infinity and NaN."""
    text = json.dumps(document, indent=2, allow_nan=False)
    path.write_text(f"{text}\n", "utf-8")
