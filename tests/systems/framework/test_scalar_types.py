"""Blocks for both scalars, made without a search of all that is loaded."""

from __future__ import annotations

import inspect

import pytest
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems import scalar_conversion
from pydrake.systems.framework import LeafSystem_

from systems.framework.scalar_types import define_for_scalars

pytestmark = pytest.mark.drake


def test_classes_are_made_without_a_search_and_convert(monkeypatch):
    def search(*_, **__):
        pytest.fail("the stack was searched, a quarter second a block")

    monkeypatch.setattr(inspect, "stack", search)
    drakes = vars(scalar_conversion)["TemplateMethod"]

    @define_for_scalars("Gain_", __name__)
    def Gain_(T):
        class Impl(LeafSystem_[T]):
            def _construct(self, *, gain=2.0, converter=None):
                LeafSystem_[T].__init__(self, converter=converter)
                self.gain = gain

            def _construct_copy(self, other, converter=None):
                Impl._construct(self, gain=other.gain, converter=converter)

        return Impl

    block = Gain_[float](gain=3.0)
    for converted in (block.ToAutoDiffXd(), block.ToScalarType[AutoDiffXd]()):
        assert type(converted) is Gain_[AutoDiffXd]
        assert converted.gain == 3.0
    assert Gain_[float].__module__ == __name__
    assert vars(scalar_conversion)["TemplateMethod"] is drakes
