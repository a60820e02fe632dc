"""Many image files on one machine: worker processes, results in input order, bounded memory.

The results do not depend on the number of jobs: each image is measured alone and by a single thread.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import cv2

from circlepose import pipeline
from circlepose._typing import Image
from circlepose.camera import Camera
from circlepose.errors import ArgumentError, CircleposeError, ImageError
from circlepose.files.images import read_image, write_image
from circlepose.pose import ImageResult, Status
from circlepose.target import Target

IN_PROCESS_FIRST = 8
"""Images that an automatic number of jobs measures before it starts workers, which takes about as long."""
IN_FLIGHT_PER_JOB = 3
"""Images handed out per worker: one at work, the others so that none waits for the slowest."""


@dataclass(frozen=True, slots=True)
class WorkItem:
    """One image file and what is needed to measure it."""

    path: Path
    name: str
    """under which the image is reported"""
    camera: Camera
    target: Target
    overlay: Path | None = None
    """where to write the picture of the result, if anywhere"""


@dataclass(frozen=True, slots=True)
class MeasureOptions:
    """How all images of a run are measured; the meaning is that of `circlepose.estimate`."""

    method: str = "chen-huang"
    refine: bool = True
    scale_calibration: bool = False
    extraction: str = "edges"


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
    except CircleposeError:
        raise
    except Exception as error:
        raise RuntimeError(f"while measuring {item.name}: {type(error).__name__}: {error}") from error


def _measure_file(item: WorkItem, options: MeasureOptions) -> ImageResult:
    try:
        image = read_image(item.path)
    except ImageError as error:
        return ImageResult(image=item.name, status=Status(error.status), reason=_without_name(error, item))
    result = pipeline.estimate(
        image,
        item.camera,
        item.target,
        method=options.method,
        refine=options.refine,
        extraction=options.extraction,
        scale_calibration=options.scale_calibration,
        name=item.name,
    )
    if item.overlay is not None:
        _write_overlay(item.overlay, image, result, item.camera)
    return result


def _without_name(error: ImageError, item: WorkItem) -> str:
    """Return what is wrong with the image; its name is told with every result."""
    return str(error).removeprefix(f"{item.path}: ").rstrip(".")


def _write_overlay(path: Path, image: Image, result: ImageResult, camera: Camera) -> None:
    from circlepose.overlay import draw_overlay  # noqa: PLC0415 - drawing is rarely asked for

    size = (image.shape[1], image.shape[0])
    if result.circles and camera.image_size not in (None, size):
        camera = camera.scaled_to(size)
    write_image(path, draw_overlay(image, result, camera))


def measure_files(
    items: Iterable[WorkItem], options: MeasureOptions, jobs: int | None = None
) -> Generator[ImageResult, None, None]:
    """Measure `items`, yielding results in their order, each as soon as it and those before it are there.

    Parameters
    ----------
    items
        Taken only a few ahead of the results, so that a stream of any length fits in memory. With several
        jobs a slow stream therefore delays its results; use one job on a live stream.
    options
        The same for all items.
    jobs
        Worker processes. 1 measures in this process; None starts one a core where there are more than a few
        images. Workers are spawned, so a script that asks for them needs the usual `__main__` guard.
    """
    if jobs is not None and jobs < 1:
        raise ArgumentError(f"jobs: expected at least 1, got {jobs}.")
    remaining = iter(items)
    cores = available_cores()
    if jobs is None:
        yield from _measure_here(islice(remaining, IN_PROCESS_FIRST) if cores > 1 else remaining, options)
    if (jobs or cores) == 1:
        yield from _measure_here(remaining, options)
        return
    # No worker is started for nothing.
    for first in islice(remaining, 1):
        yield from _measure_in_workers(first, remaining, options, jobs or cores)


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _measure_here(items: Iterable[WorkItem], options: MeasureOptions) -> Iterator[ImageResult]:
    for item in items:
        with _single_thread():
            result = measure_file(item, options)
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
    first: WorkItem, rest: Iterator[WorkItem], options: MeasureOptions, jobs: int
) -> Iterator[ImageResult]:
    context = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(jobs, mp_context=context, initializer=_start_worker)
    in_flight: deque[tuple[WorkItem, Future[ImageResult]]] = deque()
    try:
        in_flight.append((first, executor.submit(measure_file, first, options)))
        while in_flight:
            for item in islice(rest, jobs * IN_FLIGHT_PER_JOB - len(in_flight)):
                in_flight.append((item, executor.submit(measure_file, item, options)))
            item, future = in_flight.popleft()
            try:
                result = future.result()
            except BrokenProcessPool as error:
                raise RuntimeError(f"a worker process died while measuring {item.name} or one of the next") from error
            yield result
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _start_worker() -> None:
    """Make a worker leave signals to its parent and end with it, and use one thread: a core is all it has."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    cv2.setNumThreads(1)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
