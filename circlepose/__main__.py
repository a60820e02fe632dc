"""`python -m circlepose`: the command line."""

from __future__ import annotations

import sys

from circlepose_cli.entry import main

if __name__ == "__main__":
    sys.exit(main())
