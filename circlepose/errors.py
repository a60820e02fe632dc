"""What circlepose raises on misuse; expected failures of an image are statuses, not exceptions.

Every error descends from `CircleposeError`; its text is one sentence for a person: what, where,
what was expected, what to do. The command line prints that text and ends with `exit_code`.
"""


class CircleposeError(Exception):
    """Base of all errors that circlepose raises on purpose."""

    exit_code = 2


class ArgumentError(CircleposeError, ValueError):
    """A library function was called with a value that cannot be meant (shape, sign, range)."""


class UsageError(CircleposeError):
    """The command line asks for something impossible or leaves out something needed."""


class CalibrationError(CircleposeError):
    """A calibration file is unreadable, incomplete, of an unknown form or numerically unusable."""


class TargetError(CircleposeError):
    """A target description is missing, incomplete or contradicts itself."""


class SceneError(CircleposeError):
    """A scene to render is incomplete or contradicts itself."""


class ImageError(CircleposeError):
    """An image cannot be used; `status` is the machine-readable reason of `pose.Status`."""

    exit_code = 3

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class OutputError(CircleposeError):
    """A result cannot be written where it was asked for."""
