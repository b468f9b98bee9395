"""Tests of ``systems.framework.packing``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.packing import Packing


class Inner(NamedTuple):
    number: int
    array: NDArray[np.float32] | None


class Outer(NamedTuple):
    flag: bool
    inner: Inner | None
    spectrum: NDArray[np.complex128]
    pair: tuple[Inner | None, Inner | None]


EXAMPLE = Outer(
    False,
    Inner(0, np.zeros((2, 3), np.float32)),
    np.zeros(4, np.complex128),
    (Inner(0, np.zeros((2, 3), np.float32)),) * 2,
)


def draw(seed: int) -> Outer:
    rng = np.random.default_rng(seed)
    array = rng.normal(size=(2, 3)).astype(np.float32)
    spectrum = rng.normal(size=4) + 1j * rng.normal(size=4)
    return Outer(True, Inner(7, array), spectrum, (None, Inner(-3, None)))


def test_value_survives_with_types_and_bits() -> None:
    value = draw(1)
    again = Packing(EXAMPLE).unpack(Packing(EXAMPLE).pack(value))
    assert type(again) is Outer
    assert type(again.inner) is Inner
    assert again.flag is True
    assert again.inner.number == 7
    assert type(again.inner.number) is int
    assert again.inner.array is not None
    assert value.inner is not None
    assert value.inner.array is not None
    assert again.inner.array.dtype == np.float32
    assert again.inner.array.tobytes() == value.inner.array.tobytes()
    assert again.spectrum.tobytes() == value.spectrum.tobytes()
    assert again.pair[0] is None
    assert again.pair[1] == Inner(-3, None)


def test_none_leaves_no_numbers_behind() -> None:
    value = draw(1)._replace(inner=None)
    vector = Packing(EXAMPLE).pack(value)
    assert Packing(EXAMPLE).unpack(vector).inner is None
    # flag; inner: flag, count, flag, 6; spectrum: flag, 8; pair: flag, two inner ones
    assert vector.size == Packing(EXAMPLE).size == 1 + 9 + 9 + (1 + 9 + 9)
    assert not vector[1:10].any()


def test_value_shares_no_memory_with_the_vector() -> None:
    packing = Packing(EXAMPLE)
    vector = packing.pack(draw(1))
    value = packing.unpack(vector)
    vector[:] = 0.0
    assert value.spectrum.any()
