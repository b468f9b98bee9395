"""Makes templates of blocks for floats and automatic differentiation (AutoDiffXd)."""

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
    """A template that creates classes without a search for their module.

    Drake adds methods to each new class, and these methods are templates. For each of
    them, Drake searches all loaded modules once per stack frame for the module of the
    method. With nested imports, the search takes 0.25 s per block. The result is always
    the same module of Drake, so this class omits the search.
    """

    def __init__(self, name: str, scalars: Any, pairs: Any, scope: ModuleType) -> None:
        super().__init__(name, scalars, pairs, scope)
        self.__module__ = scope.__name__

    def _on_add(self, param: Any, cls: Any, skip_rename: Any) -> Any:
        if "_construct_copy" not in vars(cls):
            _make_copyable(cls, self.name)
        theirs = vars(scalar_conversion)
        searching = theirs["TemplateMethod"]
        theirs["TemplateMethod"] = functools.partial(searching, scope=scalar_conversion)
        try:
            added = super()._on_add(param, cls, skip_rename)
        finally:
            theirs["TemplateMethod"] = searching
        # Drake's constructor takes any arguments, and passes them to ``_construct``.
        if "__signature__" in vars(cls):
            self.__signature__ = shown = cls.__signature__
            own = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
            parameters = [own, *shown.parameters.values()]
            vars(cls)["__init__"].__signature__ = shown.replace(parameters=parameters)
        return added


def _make_copyable(cls: Any, name: str) -> None:
    """Defines copies for another scalar type, with the arguments of the original."""
    construct = cls._construct
    # Errors about arguments then name the block.
    inspect.unwrap(construct).__qualname__ = name.rpartition(".")[2].removesuffix("_")

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
    """Returns a decorator that makes a template of a block for float and AutoDiffXd.

    The decorated function ``name(T)`` defines the class of the block for the scalar
    type T.

    Args:
        name: Name of the template, with an underscore at its end.
        module: ``__name__`` of the module. Without this name, Drake would search all
            loaded modules, which takes 0.1 s per block.

    Returns:
        The decorator. It replaces the function by the template, and ``template[T]`` is
        a class.
    """
    return _Template.define(name, T_list=[float, AutoDiffXd], scope=sys.modules[module])
