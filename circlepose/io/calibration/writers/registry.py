"""All forms of calibration files that are written.

To add one: a module beside this one with a `WRITER`, its line here, and its key in `WrittenForm`.
"""

from __future__ import annotations

from collections.abc import Mapping

from circlepose.io.calibration.writers import WrittenForm, colmap, kalibr, mrcal, native, opencv, ros
from circlepose.io.calibration.writers.writer import Writer

WRITERS: Mapping[WrittenForm, Writer] = {
    each.key: each for each in (opencv.WRITER, ros.WRITER, kalibr.WRITER, colmap.WRITER, mrcal.WRITER, native.WRITER)
}
