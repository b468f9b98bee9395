"""How compiled functions may round.

numba links a compiled helper into its caller as it stands where both are compiled
in one process, and as a copy that was optimised with the caller where the caller is
loaded from the cache. With sums that may be reordered these two round differently:
such helpers take ``forceinline=True``, so that there is no second way
(``tests/evals/test_compiled_code.py``).
"""

from __future__ import annotations

__all__ = ["REORDER"]

#: Licence for compiled sums to reorder, so that they vectorise; NaN stays NaN.
REORDER = {"reassoc", "contract", "nsz", "arcp"}
