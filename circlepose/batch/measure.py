"""Many image files on one machine: worker processes, results in input order, bounded memory.

The results do not depend on the number of jobs: each image is measured alone and by a single thread.
An image that crashes or blocks its worker costs itself a row that says so, never the run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import TypeAlias

import cv2

from circlepose import pipeline
from circlepose._typing import Image
from circlepose.batch.workers.pool import Failed, Known, Loss, Lost, run_in_workers
from circlepose.camera.camera import Camera
from circlepose.errors import ArgumentError, CircleposeError, ImageError
from circlepose.io.images.reader import read_photograph, write_image
from circlepose.io.remote.images import Place
from circlepose.results import ImageResult, Status
from circlepose.targets.target import Target

IN_PROCESS_MOST = 8
"""Images that an automatic number of jobs measures without starting a worker, which takes about as long."""
IN_FLIGHT_PER_JOB = 32
"""Images handed out, or done but not due, per worker: enough that one slow image does not stop the others."""
DEFAULT_TIMEOUT_S = 120.0

BugReport: TypeAlias = Callable[[str, Exception], None]
"""gets the name of an image and the exception that was raised there"""


@dataclass(frozen=True, slots=True)
class WorkItem:
    """One image file and what is needed to measure it."""

    path: Place
    name: str
    """under which the image is reported"""
    camera: Camera
    target: Target
    overlay: Path | None = None
    """where to write the picture of the result, if anywhere"""
    overwrite: bool = False
    """whether the picture may replace a file that circlepose did not write"""
    world_board: Target | None = None
    """the board in the image to which poses are to be relative, if any"""


@dataclass(frozen=True, slots=True)
class MeasureOptions:
    """How all images of a run are measured; the meaning is that of `circlepose.estimate`."""

    method: str = "chen-huang"
    refine: bool = True
    scale_calibration: bool = False
    extraction: str = "edges"
    force_calibration: bool = False
    min_score: float | None = None
    max_residual_px: float | None = None


def measure_file(item: WorkItem, options: MeasureOptions) -> ImageResult:
    """Read, measure and, where asked, draw one image; a file that is no usable image gives a result that says so.

    Raises
    ------
    CircleposeError
        On misuse: contradicting options, an overlay that cannot be written.
    RuntimeError
        On a bug; its text names the image.
    """
    try:
        return _measure_file(item, options)
    except (CircleposeError, MemoryError):
        raise
    except cv2.error as error:
        if error.code == cv2.Error.StsNoMem:
            raise MemoryError(str(error)) from error
        raise RuntimeError(f"while measuring {item.name}: {error}") from error
    except Exception as error:
        raise RuntimeError(f"while measuring {item.name}: {type(error).__name__}: {error}") from error


def _measure_file(item: WorkItem, options: MeasureOptions) -> ImageResult:
    try:
        image, remark = read_photograph(item.path)
    except ImageError as error:
        return ImageResult(image=item.name, status=Status(error.status), reason=_without_name(error, item))
    result = pipeline.estimate(
        image,
        item.camera,
        item.target,
        world_board=item.world_board,
        method=options.method,
        refine=options.refine,
        extraction=options.extraction,
        scale_calibration=options.scale_calibration,
        force_calibration=options.force_calibration,
        min_score=options.min_score,
        max_residual_px=options.max_residual_px,
        name=item.name,
    )
    if item.overlay is not None:
        _write_overlay(item.overlay, image, result, item.camera, overwrite=item.overwrite)
    remarks = "; ".join(each for each in (remark, result.remark) if each)
    return replace(result, remark=remarks) if remark else result


def _without_name(error: ImageError, item: WorkItem) -> str:
    """Return what is wrong with the image; its name is reported with every result."""
    return str(error).removeprefix(f"{item.path}: ").rstrip(".")


def _write_overlay(path: Path, image: Image, result: ImageResult, camera: Camera, *, overwrite: bool) -> None:
    from circlepose.drawing.overlay import draw_overlay  # noqa: PLC0415 - drawing is rarely asked for

    write_image(path, draw_overlay(image, result, camera), drawn=True, overwrite=overwrite)


def measure_files(
    items: Iterable[WorkItem | ImageResult],
    options: MeasureOptions,
    jobs: int | None = None,
    timeout_s: float | None = None,
    on_bug: BugReport | None = None,
) -> Generator[ImageResult, None, None]:
    """Measure `items`, yielding results in their order, each as soon as it and those before it are there.

    Parameters
    ----------
    items
        Files to measure; a result among them is passed on in its place. They are taken only a little ahead of
        the results, so that a stream of any length fits in memory; where there are workers, by a thread, so that
        a slow stream delays no result.
    options
        The same for all items.
    jobs
        Worker processes. None starts one a core where there are more than a few images, and else measures in
        this process. Workers are spawned, so a script that asks for them needs the usual `__main__` guard.
    timeout_s
        Time for one image, in s; if it takes longer, its status is `timed_out`. None is `DEFAULT_TIMEOUT_S` for
        workers; without workers, time is not limited, so that a number asks for workers.
    on_bug
        Where given, it gets each bug, which becomes the status `internal_error` of its image.

    Raises
    ------
    CircleposeError
        On misuse: contradicting options, an overlay that cannot be written.
    RuntimeError
        On a bug, unless there is `on_bug`; its text names the image.
    """
    if jobs is not None and jobs < 1:
        raise ArgumentError(f"jobs: expected at least 1, got {jobs}.")
    if timeout_s is not None and not timeout_s > 0.0:
        raise ArgumentError(f"timeout_s: expected a positive time in s, got {timeout_s:g}.")
    remaining = iter(items)
    if jobs is None and timeout_s is None:
        first = list(islice(remaining, IN_PROCESS_MOST + 1))
        if len(first) <= IN_PROCESS_MOST:
            yield from measure_here(first, options, on_bug)
            return
        remaining = chain(first, remaining)
    jobs = jobs or available_cores()
    yield from _measure_in_workers(remaining, options, jobs, timeout_s or DEFAULT_TIMEOUT_S, on_bug)


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def measure_here(
    items: Iterable[WorkItem | ImageResult], options: MeasureOptions, on_bug: BugReport | None
) -> Iterator[ImageResult]:
    """As `measure_files`, one image after the other in this process."""
    for item in items:
        if isinstance(item, ImageResult):
            yield item
            continue
        try:
            with _single_thread():
                result = measure_file(item, options)
        except MemoryError:
            result = ImageResult(item.name, Status.WORKER_DIED, "memory ran out")
        except RuntimeError as error:
            result = result_of_bug(item, error, on_bug)
        yield result


@contextmanager
def _single_thread() -> Iterator[None]:
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def _measure_in_workers(
    items: Iterable[WorkItem | ImageResult],
    options: MeasureOptions,
    jobs: int,
    timeout_s: float,
    on_bug: BugReport | None,
) -> Iterator[ImageResult]:
    outcomes = run_in_workers(
        partial(measure_alone, options=options),
        (Known(item) if isinstance(item, ImageResult) else item for item in items),
        jobs=jobs,
        timeout_s=timeout_s,
        window=jobs * IN_FLIGHT_PER_JOB,
    )
    with closing(outcomes):
        for outcome in outcomes:
            if isinstance(outcome, Lost):
                yield _result_of_loss(outcome, timeout_s)
            elif isinstance(outcome, Failed):
                yield result_of_bug(outcome.item, outcome.error, on_bug)
            else:
                yield outcome


def measure_alone(item: WorkItem, options: MeasureOptions) -> ImageResult:
    """Measure as `measure_file`, in a worker process, by one thread: a core is all it has."""
    cv2.setNumThreads(1)
    return measure_file(item, options)


def _result_of_loss(lost: Lost[WorkItem], timeout_s: float) -> ImageResult:
    if lost.loss is Loss.TIMED_OUT:
        return result_of_timeout(lost.item, timeout_s)
    return ImageResult(lost.item.name, Status.WORKER_DIED, f"its worker process died twice ({lost.detail})")


def result_of_timeout(item: WorkItem, timeout_s: float) -> ImageResult:
    """Return the result of an image that took too long."""
    return ImageResult(item.name, Status.TIMED_OUT, f"was not measured within {timeout_s:g} s")


def result_of_bug(item: WorkItem, error: Exception, on_bug: BugReport | None) -> ImageResult:
    """Return the result of an image at which `error` was raised; raises it if it is misuse, or nobody handles it."""
    if on_bug is None or isinstance(error, CircleposeError):
        raise error
    on_bug(item.name, error)
    reason = str(error).removeprefix(f"while measuring {item.name}: ")
    return ImageResult(item.name, Status.INTERNAL_ERROR, reason)
