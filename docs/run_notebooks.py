"""Runs docs/notebooks, each in a fresh kernel: `python docs/run_notebooks.py`. Needs the extra `docs`."""

from __future__ import annotations

import sys
import time

from nbclient.exceptions import CellExecutionError

from sitegen.notebooks import NOTEBOOKS, executed

failed = 0
for path in sorted(NOTEBOOKS.glob("*.ipynb")):
    began = time.monotonic()
    try:
        executed(path)
    except CellExecutionError as error:
        failed += 1
        print(f"{path.name}: failed\n{error}")
    else:
        print(f"{path.name}: ran in {time.monotonic() - began:.1f} s")
sys.exit(1 if failed else 0)
