"""``python -m phonotaxis``: the command line."""

from __future__ import annotations

import sys

from phonotaxis import main

if __name__ == "__main__":
    sys.exit(main())
