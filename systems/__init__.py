"""The blocks: one LeafSystem per file, with its pure function beside it.

Templated blocks (float, AutoDiffXd) also have a name that ends in an
underscore, as in Drake: ``DiffDrivePlant`` is ``DiffDrivePlant_[float]``.
``__init__.pyi`` lists them; a block is loaded at its first use.
"""

import lazy_loader

import systems.framework.compiling  # noqa: F401  # before anything is compiled

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
