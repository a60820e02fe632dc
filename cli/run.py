"""`circlepose estimate` at work: inputs -> work items -> results -> output, and the exit code."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from circlepose.batch.local import MeasureOptions, WorkItem, measure_files
from circlepose.files.atomic import atomic_writer
from circlepose.files.inputs import STDIN, InputImage, expand_inputs
from circlepose_cli.interruption import EXIT_CODE as INTERRUPTED
from circlepose_cli.interruption import Interruption
from circlepose_cli.options import ExtractionChoice, FormatChoice, LayoutChoice, MethodChoice, TargetOverrides
from circlepose_cli.output import choose_format, write_output
from circlepose_cli.overlay_names import OverlayNames
from circlepose_cli.progress import Reporter, follow
from circlepose_cli.setup import Setup, Setups

SOME_FAILED = 3


@dataclass(frozen=True, slots=True)
class Request:
    """What the command line asks for."""

    inputs: tuple[str, ...]
    recursive: bool
    calib: Path | None
    camera_name: str | None
    target_file: Path | None
    radius_mm: float | None
    overrides: TargetOverrides
    method: MethodChoice
    refine: bool
    extraction: ExtractionChoice
    scale_calibration: bool
    output_format: FormatChoice | None
    layout: LayoutChoice
    output: Path | None
    overlay: Path | None
    jobs: int | None
    quiet: bool
    verbose: bool


def run(request: Request) -> int:
    """Measure all images that are asked for and return the exit code."""
    reporter = Reporter(quiet=request.quiet, verbose=request.verbose)
    setups = Setups(
        calib=request.calib,
        camera_name=request.camera_name,
        target_file=request.target_file,
        radius_mm=request.radius_mm,
        overrides=request.overrides,
        tell=lambda folder, setup: _tell_setup(reporter, folder, setup),
    )
    images, total = _images(request, setups)
    overlays = None if request.overlay is None else OverlayNames(request.overlay, images if total else ())
    items = _work_items(images, setups, overlays)
    options = MeasureOptions(
        request.method.value, request.refine, request.scale_calibration, request.extraction.value
    )
    to_terminal = request.output is None and sys.stdout.isatty()
    output_format = choose_format(request.output_format, request.output, to_terminal=to_terminal)
    # Rows that go to the terminal one by one would tear a bar.
    shows_bar = not (to_terminal and output_format is not FormatChoice.TABLE)
    with _output(request.output) as handle, Interruption() as interruption:
        bar = reporter.running(total, shows_bar=shows_bar)
        results = follow(measure_files(items, options, request.jobs), reporter, bar, interruption)
        write_output(results, handle, output_format=output_format, layout=request.layout)
    reporter.summary(total, interrupted=interruption.received)
    if interruption.received:
        return INTERRUPTED
    return SOME_FAILED if reporter.failures else 0


def _images(request: Request, setups: Setups) -> tuple[Iterable[InputImage], int | None]:
    """Return the images and, unless they come on standard input, their number, once all have a setup."""
    stdin = sys.stdin.buffer if sys.stdin else None
    images = expand_inputs(request.inputs, stdin, request.recursive)
    if STDIN in request.inputs:
        return images, None
    known = list(images)
    for image in known:
        setups.for_image(image.path)
    return known, len(known)


def _work_items(images: Iterable[InputImage], setups: Setups, overlays: OverlayNames | None) -> Iterator[WorkItem]:
    for image in images:
        setup = setups.for_image(image.path)
        overlay = None if overlays is None else overlays.path_for(image)
        yield WorkItem(image.path, image.name, setup.camera_file.camera, setup.target, overlay)


def _output(path: Path | None) -> AbstractContextManager[TextIO]:
    if path is not None:
        return atomic_writer(path)
    if isinstance(sys.stdout, io.TextIOWrapper):
        # The same bytes whatever the locale; line ends as in a file.
        sys.stdout.reconfigure(encoding="utf-8", newline="")
    return nullcontext(sys.stdout)


def _tell_setup(reporter: Reporter, folder: Path, setup: Setup) -> None:
    for note in setup.camera_file.notes:
        reporter.note(f"{setup.camera_file.path}: {note}.")
    reporter.detail(f"{folder}: camera {setup.camera_file.path}, target {setup.target_origin}")
