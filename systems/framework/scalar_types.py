"""Blocks for floats and for derivatives."""

from __future__ import annotations

import functools
import inspect
import sys
from types import ModuleType
from typing import Any

from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems import scalar_conversion
from pydrake.systems.scalar_conversion import TemplateSystem


class _Template(TemplateSystem):
    """Makes classes without a search for the module that they belong to.

    Drake gives each new class methods that are templates themselves, and lets them
    search all that is loaded, once for every frame of the stack, for a module that is
    always its own. Where imports are deep, that takes a quarter second a block.
    """

    def __init__(self, name: str, scalars: Any, pairs: Any, scope: ModuleType) -> None:
        super().__init__(name, scalars, pairs, scope)
        self.__module__ = scope.__name__

    def _on_add(self, param: Any, cls: type, skip_rename: Any) -> Any:
        if "_construct_copy" not in vars(cls):
            _make_copyable(cls)
        theirs = vars(scalar_conversion)
        searching = theirs["TemplateMethod"]
        theirs["TemplateMethod"] = functools.partial(searching, scope=scalar_conversion)
        try:
            return super()._on_add(param, cls, skip_rename)
        finally:
            theirs["TemplateMethod"] = searching


def _make_copyable(cls: Any) -> None:
    """A copy for another scalar type is made with the arguments of the original."""
    construct = cls._construct

    @functools.wraps(construct)
    def construct_and_remember(
        self: Any, *, converter: Any = None, **options: Any
    ) -> None:
        construct(self, converter=converter, **options)
        self._options = options

    def construct_copy(self: Any, other: Any, converter: Any = None) -> None:
        construct_and_remember(self, converter=converter, **other._options)

    cls._construct, cls._construct_copy = construct_and_remember, construct_copy
    signature = inspect.signature(construct)
    shown = [p for p in signature.parameters.values() if p.name != "converter"]
    cls.__signature__ = signature.replace(parameters=shown[1:])


def define_for_scalars(name: str, module: str) -> Any:
    """Decorator of a function ``name(T)`` that makes a block's class.

    The template has the block for float and for AutoDiffXd.

    Args:
        name: Of the template, with an underscore at its end.
        module: ``__name__`` of the module. Drake would find it by itself, by
            searching all that is loaded for 0.1 s a block.

    Returns:
        The decorator; it gives back the template, ``template[T]`` of which is a class.
    """
    return _Template.define(name, T_list=[float, AutoDiffXd], scope=sys.modules[module])
