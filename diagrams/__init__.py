"""Describes scenarios, connects their blocks in diagrams, and runs the diagrams.

``__init__.pyi`` lists the public names. Python loads each name when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
