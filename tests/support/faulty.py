"""What worker processes are given to do in tests: well-behaved or not. Imported by the workers, so kept light."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path


class UnsendableError(Exception):
    """Cannot be made again from its arguments, as pickle does."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(f"{first} {second}")


def act(task: tuple[str, object]) -> object:
    """Do what the task says and return its value."""
    what, value = task
    if what == "sleep":
        time.sleep(float(str(value)))
    elif what == "exit":
        os._exit(3)
    elif what == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    elif what == "kill once":
        marker = Path(str(value))
        if not marker.exists():
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    elif what == "memory":
        raise MemoryError
    elif what == "raise":
        raise ValueError(value)
    elif what == "raise unsendable":
        raise UnsendableError("odd", str(value))
    return value


class Unwelcome:
    """A function that no worker can load."""

    def __reduce__(self) -> tuple[object, tuple[int]]:
        return os._exit, (7,)

    def __call__(self, task: object) -> object:
        return task
