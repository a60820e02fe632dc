"""`circlepose estimate` at work: inputs -> work items -> results -> output, and the exit code."""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from circlepose.batch.journal import Journal
from circlepose.batch.local import MeasureOptions, WorkItem, available_cores, measure_files
from circlepose.batch.resume import measure_with_journal
from circlepose.errors import ArgumentError, UsageError
from circlepose.files.inputs import InputImage, are_streamed, expand_inputs
from circlepose.files.reference import Reference, read_reference
from circlepose.files.remote import Place, place_of
from circlepose.pose import ImageResult
from circlepose.solvers import methods_for
from circlepose_cli.destination import open_journal, open_output
from circlepose_cli.interruption import EXIT_CODE as INTERRUPTED
from circlepose_cli.interruption import Interruption
from circlepose_cli.lines import lines
from circlepose_cli.options import ExtractionChoice, FormatChoice, LayoutChoice, MethodChoice, TargetOverrides
from circlepose_cli.output import choose_format, write_output
from circlepose_cli.overlay_names import OverlayNames
from circlepose_cli.progress import Reporter, follow
from circlepose_cli.setup import Setup, Setups

SOME_FAILED = 3
BUG = 1


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
    reference: Path | None
    output: str | None
    overlay: Path | None
    jobs: int | None
    cluster: str | None
    timeout_s: float | None
    resume: bool
    quiet: bool
    verbose: bool


def run(request: Request) -> int:
    """Measure all images that are asked for and return the exit code."""
    if request.cluster is not None and request.jobs is not None:
        raise UsageError("--jobs, --cluster: give one of them; how many measure is the cluster's affair.")
    output = None if request.output is None else place_of(request.output)
    reporter = Reporter(quiet=request.quiet, verbose=request.verbose)
    setups = Setups(
        calib=request.calib,
        camera_name=request.camera_name,
        target_file=request.target_file,
        radius_mm=request.radius_mm,
        overrides=request.overrides,
        tell=lambda folder, setup: _accept_setup(reporter, folder, setup, request.method),
    )
    reference = _reference(request)
    images, total = _images(request, setups)
    if reference is not None and total is not None:
        _check_reference(reference, request, images)
    overlays = None if request.overlay is None else OverlayNames(request.overlay, images if total else ())
    items = _work_items(images, setups, overlays)
    options = MeasureOptions(
        request.method.value, request.refine, request.scale_calibration, request.extraction.value
    )
    to_terminal = output is None and sys.stdout.isatty()
    output_format = choose_format(request.output_format, output, to_terminal=to_terminal)
    # Rows that go to the terminal one by one would tear a bar.
    shows_bar = not (to_terminal and output_format is not FormatChoice.TABLE)
    with open_journal(output, options, resume=request.resume) or nullcontext() as journal:
        if journal is not None and journal.discarded:
            reporter.note(f"{journal.path}: was left by an unfinished run; it is begun anew, without --resume")
        with open_output(output, journal) as handle, Interruption() as interruption:
            bar = reporter.running(total, shows_bar=shows_bar)
            measured = _measured(items, options, request, reporter, journal, total)
            with closing(follow(measured, reporter, bar, interruption)) as results:
                write_output(results, handle, output_format=output_format, layout=request.layout, reference=reference)
        is_done = not (interruption.received or reporter.lost)
        if journal is not None and is_done:
            journal.remove()
    reporter.summary(total, interrupted=interruption.received, resumable=journal is not None and not is_done)
    if interruption.received:
        return INTERRUPTED
    if reporter.bugs:
        return BUG
    return SOME_FAILED if reporter.failures else 0


def _measured(
    items: Iterable[WorkItem],
    options: MeasureOptions,
    request: Request,
    reporter: Reporter,
    journal: Journal | None,
    total: int | None,
) -> Generator[ImageResult, None, None]:
    # A stream may be slow or endless: without workers a silent producer would hold back what is done.
    jobs = available_cores() if total is None and request.jobs is None else request.jobs
    measure = partial(measure_files, jobs=jobs)
    if request.cluster is not None:
        from circlepose.batch.cluster import measure_on_cluster  # noqa: PLC0415 - few ask for it

        measure = partial(measure_on_cluster, address=request.cluster, tell=reporter.note)
    measure = partial(measure, options=options, timeout_s=request.timeout_s, on_bug=reporter.bug)
    return measure(items) if journal is None else measure_with_journal(items, journal, measure)


def _images(request: Request, setups: Setups) -> tuple[Iterable[InputImage], int | None]:
    """Return the images and, unless they come as a stream, their number, once all have a setup."""
    stdin = lines(sys.stdin.buffer) if sys.stdin else None
    images = expand_inputs(request.inputs, stdin, request.recursive)
    if are_streamed(request.inputs):
        return images, None
    known = list(images)
    for image in known:
        setups.for_image(image.path)
    return known, len(known)


def _reference(request: Request) -> Reference | None:
    if request.reference is None:
        return None
    if request.layout is not LayoutChoice.TABLE2:
        raise UsageError("--reference: goes with --layout table2; circlepose check compares whole tables.")
    return read_reference(request.reference)


def _check_reference(reference: Reference, request: Request, images: Iterable[InputImage]) -> None:
    names = [image.name for image in images]
    if not any(reference.knows(name) for name in names):
        ours, theirs = names[0], next(iter(reference.by_image), "none")
        raise UsageError(
            f"--reference: {request.reference} has none of the images; it names {theirs}, they are {ours}."
        )


def _work_items(images: Iterable[InputImage], setups: Setups, overlays: OverlayNames | None) -> Iterator[WorkItem]:
    for image in images:
        setup = setups.for_image(image.path)
        overlay = None if overlays is None else overlays.path_for(image)
        yield WorkItem(image.path, image.name, setup.camera_file.camera, setup.target, overlay)


def _accept_setup(reporter: Reporter, folder: Place, setup: Setup, method: MethodChoice) -> None:
    try:
        methods_for(setup.target.kind, method.value)
    except ArgumentError as error:
        raise UsageError(f"{setup.target_origin}: --{error}") from None
    for note in setup.camera_file.notes:
        reporter.note(f"{setup.camera_file.path}: {note}.")
    reporter.detail(f"{folder}: camera {setup.camera_file.path}, target {setup.target_origin}")
