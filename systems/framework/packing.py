"""Packs named tuples into vectors, so that a Drake context can store them."""

from __future__ import annotations

from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

V = TypeVar("V", bound=tuple[Any, ...])


class Packing(Generic[V]):
    """Converts a named tuple to a vector of float64 and back without a loss.

    A field of the named tuple is a number, an array, or an inner tuple of these. An
    array or an inner tuple can also be None. In the vector, a flag (0 or 1) precedes
    each array and each inner tuple. If the flag is 0, the value is None, and its
    elements in the vector have no meaning.

    Args:
        example: A value with the types and shapes of all later values. A field that is
            None in the example is None in all values, and takes no element.
    """

    def __init__(self, example: V) -> None:
        self._fields = _Tuple(example)
        self.size = self._fields.size
        """Number of elements of the vector."""

    def pack(self, value: V) -> NDArray[np.float64]:
        """Returns the vector of a value."""
        vector = np.zeros(self.size)
        self._fields.write(value, vector)
        return vector

    def unpack(self, vector: NDArray[np.float64]) -> V:
        """Returns the value of a vector. The value shares no memory with the vector."""
        value: V = self._fields.read(vector)
        return value


class _Number:
    size = 1

    def __init__(self, example: Any) -> None:
        self._type = type(example)

    def write(self, value: Any, vector: NDArray[np.float64]) -> None:
        vector[0] = value

    def read(self, vector: NDArray[np.float64]) -> Any:
        return self._type(vector[0])


class _Array:
    def __init__(self, example: NDArray[Any]) -> None:
        self._shape, self._dtype = example.shape, example.dtype
        self._real = example.real.dtype
        self.size = example.ravel().view(self._real).size

    def write(self, value: NDArray[Any], vector: NDArray[np.float64]) -> None:
        vector[:] = np.ascontiguousarray(value).ravel().view(self._real)

    def read(self, vector: NDArray[np.float64]) -> Any:
        return vector.astype(self._real).view(self._dtype).reshape(self._shape)


class _Tuple:
    def __init__(self, example: tuple[Any, ...]) -> None:
        named = hasattr(example, "_make")
        self._make: Any = type(example)._make if named else tuple  # type: ignore[attr-defined]
        self._fields: list[tuple[Any, int, int, bool]] = []
        place = 0
        for part in example:
            field: Any = None
            if isinstance(part, tuple):
                field = _Tuple(part)
            elif isinstance(part, np.ndarray):
                field = _Array(part)
            elif part is not None:
                field = _Number(part)
            flagged = isinstance(field, _Tuple | _Array)
            begin = place + flagged
            place = begin + (field.size if field else 0)
            self._fields.append((field, begin, place, flagged))
        self.size = place

    def write(self, value: tuple[Any, ...], vector: NDArray[np.float64]) -> None:
        for part, (field, begin, end, flagged) in zip(value, self._fields, strict=True):
            if part is not None:
                if flagged:
                    vector[begin - 1] = 1.0
                field.write(part, vector[begin:end])

    def read(self, vector: NDArray[np.float64]) -> Any:
        return self._make(
            None
            if field is None or (flagged and vector[begin - 1] == 0.0)
            else field.read(vector[begin:end])
            for field, begin, end, flagged in self._fields
        )
