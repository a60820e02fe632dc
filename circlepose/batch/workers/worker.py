"""What a worker process does: it answers one item after the other, until its parent wants no more or ends."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
import traceback
from collections.abc import Callable
from multiprocessing import connection
from typing import Any

_NO_MEMORY = 112


def how_it_ended(exitcode: int | None) -> str:
    """Return in words what the exit code of a worker means."""
    if exitcode is not None and exitcode < 0:
        try:
            name = signal.Signals(-exitcode).name
        except ValueError:
            name = f"signal {-exitcode}"
        return f"killed by {name}"
    return "memory ran out" if exitcode == _NO_MEMORY else f"exit code {exitcode}"


def work(function: Callable[[Any], Any], pipe: connection.Connection[Any, Any]) -> None:
    """Work in another process: answer each item with (True, result) or (False, exception)."""
    # Signals are the parent's to handle: Ctrl-C reaches all processes of a terminal.
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        pipe.send((True, None))
        while True:
            _answer(pipe, function, pipe.recv())
    except (EOFError, OSError):
        # The parent wants no more.
        return


def _answer(pipe: connection.Connection[Any, Any], function: Callable[[Any], Any], item: Any) -> None:
    try:
        answer = (True, function(item))
    except MemoryError:
        # What is left of this process is of no use; another one may have more.
        os._exit(_NO_MEMORY)
    except Exception as error:
        answer = (False, _portable(error))
    pipe.send(answer)


def _portable(error: Exception) -> Exception:
    """Return `error` with its traceback as a note, or its text where it cannot be sent to another process."""
    note = f"in a worker process:\n{traceback.format_exc().rstrip()}"
    try:
        error = pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(note)
    return error


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)
