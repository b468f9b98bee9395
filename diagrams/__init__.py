"""Scenarios, the builder that wires blocks, and the run.

``__init__.pyi`` lists what it offers; a name is loaded at its first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
