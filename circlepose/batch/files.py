"""Many image files from Python: an iterator over their results."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator
from typing import TypeAlias

from circlepose import _arguments
from circlepose.batch.measure import MeasureOptions, WorkItem, measure_files, measure_here
from circlepose.camera.camera import Camera
from circlepose.detection import EXTRACTIONS
from circlepose.errors import ArgumentError, UsageError
from circlepose.io.inputs.images import InputImage, expand_inputs
from circlepose.io.remote.images import is_url, place_of
from circlepose.io.text.escaping import redacted
from circlepose.pipeline.world import check_world_board
from circlepose.results import ImageResult
from circlepose.solvers import METHODS, methods_for
from circlepose.targets.target import Target

FilePath: TypeAlias = str | os.PathLike[str]
_EXPECTED = "the path of an image, a folder or a glob, or several of them"
_JOBS = "a whole number of at least 1, or None"
_logger = logging.getLogger("circlepose")


def measure(
    images: FilePath | Iterable[FilePath],
    camera: Camera,
    target: Target,
    *,
    world_board: Target | None = None,
    recursive: bool = False,
    jobs: int | None = 1,
    timeout_s: float | None = None,
    method: str = "chen-huang",
    refine: bool = True,
    extraction: str = EXTRACTIONS[0],
    scale_calibration: bool = False,
    force_calibration: bool = False,
    min_score: float | None = None,
    max_residual_px: float | None = None,
) -> Iterator[ImageResult]:
    """Measure many image files; yield a result for each, in order, as soon as it is there.

    Parameters
    ----------
    images
        A file, a folder, a glob or a URL, or a sequence of them, as the command line takes them. Of an iterator each
        part is the path or URL of one image and is taken shortly before it is measured, so that it may be endless.
    camera, target, world_board
        As of `circlepose.estimate`; the same for all images.
    recursive
        Whether a folder also stands for the images in the folders below it.
    jobs
        1 measures in this process. A larger number starts so many worker processes, None one a core where there are
        more than a few images: a script that asks for workers needs the usual `if __name__ == "__main__":`.
    timeout_s
        Time for one image, in s; if it takes longer, its status is `timed_out`. Needs a worker, which it starts.
    method, refine, extraction, scale_calibration, force_calibration, min_score, max_residual_px
        As of `circlepose.estimate`.

    Returns
    -------
    An iterator. A file that cannot be read or measured has a result whose status and reason say why; it raises
    nothing. So has an image at which a bug shows (`internal_error`), which is logged to the logger `circlepose`.

    Raises
    ------
    CircleposeError
        At the call, on misuse: `ArgumentError`, naming the parameter; `UsageError` for a folder or glob without an
        image.
    """
    _arguments.instance_of(Camera, "camera", camera, _arguments.HOW_CAMERA)
    _arguments.instance_of(Target, "target", target, _arguments.HOW_TARGET)
    check_world_board(world_board, target)
    _arguments.one_of(("all", *METHODS), "method", method)
    methods_for(target.kind, method)
    _arguments.one_of(EXTRACTIONS, "extraction", extraction)
    options = MeasureOptions(
        method=method,
        refine=_arguments.truth("refine", refine),
        scale_calibration=_arguments.truth("scale_calibration", scale_calibration),
        extraction=extraction,
        force_calibration=_arguments.truth("force_calibration", force_calibration),
        min_score=_arguments.score("min_score", min_score),
        max_residual_px=_arguments.bound_px("max_residual_px", max_residual_px),
    )
    if jobs is not None and _arguments.whole("jobs", jobs, _JOBS) < 1:
        raise ArgumentError(f"jobs: expected {_JOBS}, got {jobs}.")
    if timeout_s is not None and _arguments.number("timeout_s", timeout_s, "a positive time in s") <= 0.0:
        raise ArgumentError(f"timeout_s: expected a positive time in s, got {timeout_s:g}.")
    found = _found(images, _arguments.truth("recursive", recursive))
    items = (WorkItem(image.path, image.name, camera, target, world_board=world_board) for image in found)
    if jobs == 1 and timeout_s is None:
        return measure_here(items, options, _log_bug)
    return measure_files(items, options, jobs, timeout_s, _log_bug)


def _found(images: object, recursive: bool) -> Iterator[InputImage]:
    if isinstance(images, str | os.PathLike):
        typed = [_path(images)]
    elif isinstance(images, Iterator):
        return map(_one_image, images)
    else:
        typed = [_path(each) for each in _arguments.parts("images", images, _EXPECTED)]
    if not typed:
        return iter(())
    try:
        return expand_inputs(typed, recursive=recursive)
    except UsageError as error:
        raise UsageError(str(error).replace("add --recursive", "set recursive")) from None


def _path(value: object) -> str:
    if isinstance(value, str | os.PathLike):
        path = os.fspath(value)
        if isinstance(path, str) and path:
            return path
    raise ArgumentError(f"images: expected {_EXPECTED}, got {_arguments.shown(value)}.")


def _one_image(value: object) -> InputImage:
    path = _path(value)
    return InputImage(place_of(path), redacted(path) if is_url(path) else path)


def _log_bug(name: str, error: Exception) -> None:
    _logger.error("%s: a bug in circlepose; please report it", name, exc_info=error)
