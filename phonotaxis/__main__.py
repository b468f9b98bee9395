"""``python -m phonotaxis``: runs the command line."""

from __future__ import annotations

import sys

from phonotaxis import main

if __name__ == "__main__":
    sys.exit(main())
