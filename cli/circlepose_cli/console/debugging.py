"""Whether tracebacks are shown: for `--verbose` and for CIRCLEPOSE_DEBUG=1 only."""

from __future__ import annotations

_state = {"tracebacks": False}


def show_tracebacks(shown: bool) -> None:
    """Turn tracebacks on or off."""
    _state["tracebacks"] = shown


def tracebacks_shown() -> bool:
    """Tell whether tracebacks are shown."""
    return _state["tracebacks"]
