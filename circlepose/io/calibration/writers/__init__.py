"""Calibration files that are written, a form a file: the inverse of `forms`."""

from __future__ import annotations

from typing import Literal

WrittenForm = Literal["opencv", "ros", "kalibr", "colmap", "mrcal", "circlepose"]
"""what `circlepose camera --to` takes"""
