"""What holds for the whole process: whether tracebacks are shown, and threads under NumPy."""

from __future__ import annotations

import os

_state = {"tracebacks": False}


def begin(*, verbose: bool) -> None:
    """Begin a command: `verbose` shows tracebacks, and NumPy, not imported yet, is to work in one thread."""
    if verbose:
        show_tracebacks(True)
    use_one_thread()


def show_tracebacks(shown: bool) -> None:
    """Turn tracebacks on or off: they are for `--verbose` and for CIRCLEPOSE_DEBUG=1 only."""
    _state["tracebacks"] = shown


def tracebacks_shown() -> bool:
    """Return whether tracebacks are shown."""
    return _state["tracebacks"]


def use_one_thread() -> None:
    """Limit BLAS to one thread, unless the user has set a number. Call this before NumPy is imported.

    The cores are shared out by process, so threads would compete for them; and a sum in several threads differs in
    its last digit.
    """
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")


def forget_odd_sizes() -> None:
    """Drop a size of the terminal from the environment that is no number: Rich would end at some of them."""
    for name in ("COLUMNS", "LINES"):
        size = os.environ.get(name)
        if size is not None and not (size.isascii() and size.isdigit()):
            del os.environ[name]
