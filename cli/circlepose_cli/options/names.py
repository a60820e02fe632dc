"""The library's reasons name its parameters; on the command line they name options."""

from __future__ import annotations

from dataclasses import replace

from circlepose.results import ImageResult

_OPTIONS = {"set scale_calibration": "give --scale-calib", "set force_calibration": "give --force-calib"}


def with_options_named(result: ImageResult) -> ImageResult:
    """Return `result` with options in its reason in place of parameters of the library."""
    reason = result.reason
    for parameter, option in _OPTIONS.items():
        reason = reason.replace(parameter, option)
    return result if reason == result.reason else replace(result, reason=reason)
