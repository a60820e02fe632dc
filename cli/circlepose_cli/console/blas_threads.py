"""Threads of the linear algebra under NumPy."""

from __future__ import annotations

import os


def one_thread() -> None:
    """Have it work in one thread; to be said before NumPy is there.

    Cores are shared out by process, so that threads would only be in each other's way; and sums in several threads
    differ in the last digit. What the user set stands.
    """
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
