"""Blocks for floats and for derivatives."""

from __future__ import annotations

import sys
from typing import Any

from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.scalar_conversion import TemplateSystem

__all__ = ["define_for_scalars"]


def define_for_scalars(name: str, module: str) -> Any:
    """Decorator of a function ``name(T)`` that makes a block's class.

    The template has the block for float and for AutoDiffXd.

    Args:
        name: Of the template, with an underscore at its end.
        module: ``__name__`` of the module. Drake would find it by itself, by
            searching all that is loaded for 0.1 s a block.
    """
    return TemplateSystem.define(
        name, T_list=[float, AutoDiffXd], scope=sys.modules[module]
    )
