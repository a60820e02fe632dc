"""`circlepose estimate` at work: inputs -> work items -> results -> output, and the exit code."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Generator, Iterable, Iterator
from contextlib import ExitStack, closing, nullcontext, suppress
from dataclasses import asdict
from functools import partial
from itertools import chain, islice
from pathlib import Path

from circlepose.batch.journal import Journal
from circlepose.batch.measure import MeasureOptions, WorkItem, available_cores, measure_files
from circlepose.batch.resume import measure_with_journal
from circlepose.boards.world import relative_to_world
from circlepose.errors import ArgumentError, UsageError
from circlepose.io.images.unread_kinds import skipped_line
from circlepose.io.inputs.images import STDIN, InputImage, are_streamed, expand_inputs
from circlepose.io.output_conflicts import Outputs
from circlepose.io.remote.images import Place
from circlepose.io.tables import Layout
from circlepose.io.tables.data_layouts import is_data_layout
from circlepose.io.tables.reference import Reference, read_reference
from circlepose.io.tables.selection import Selection
from circlepose.results import ImageResult
from circlepose.solvers import methods_for
from circlepose_cli.console.interruption import EXIT_CODE as INTERRUPTED
from circlepose_cli.console.interruption import Interruption
from circlepose_cli.console.progress import Reporter, follow
from circlepose_cli.console.stdin_lines import standard_input
from circlepose_cli.options.declared import FormatChoice
from circlepose_cli.options.requests import EstimateRequest
from circlepose_cli.options.setup import Setup, Setups
from circlepose_cli.output.destination import Unfinished, is_file, open_journal, open_output, output_place
from circlepose_cli.output.overlay_names import OverlayNames
from circlepose_cli.output.results import choose_format, choose_rows, write_output
from circlepose_cli.runs.layout_choice import USUAL, LayoutChoice

SOME_FAILED = 3
BUG = 1


def run(request: EstimateRequest) -> int:
    """Measure all images that are asked for and return the exit code."""
    with ExitStack() as held:
        return _run(request, held)


def _run(request: EstimateRequest, held: ExitStack) -> int:
    output = output_place(request.output)
    to_terminal = output is None and sys.stdout.isatty()
    output_format = choose_format(request.output_format, output, to_terminal=to_terminal)
    _check_form(output_format, request)
    layouts = LayoutChoice(request.layout, request.method, is_stream=are_streamed(request.inputs))
    outputs = Outputs([output])
    reporter = Reporter(quiet=request.quiet, verbose=request.verbose)
    setups = Setups(
        request.known,
        lambda folder, setup: _accept_setup(reporter, outputs, folder, setup, request.method, layouts),
        force_calibration=request.stages.force_calibration,
        world_board=request.world_board,
    )
    reference = _reference(request)
    outputs.refuse(request.reference, "the reference")
    if STDIN in request.inputs:
        # Standard output may be the list, too: `< list >> list`.
        (Outputs([1]) if output is None else outputs).refuse(0, "the list of images")
    skipped: Counter[str] = Counter()
    images, total = _images(request, setups, outputs, skipped, held)
    if total is not None:
        _selection(request, output_format, layouts.choose())
        reporter.notes(layouts.notes())
        _check_reference(reference, request, images)
    overlays = (
        None
        if request.overlay is None
        else OverlayNames(request.overlay, images if total else (), overwrite=request.overwrite)
    )
    if overlays is not None:
        _refuse_pictures(overlays, output, request, images if total else (), setups)
    items = _work_items(images, setups, overlays, overwrite=request.overwrite)
    options = MeasureOptions(request.method, **asdict(request.stages))
    # Rows that go to the terminal one by one would tear a bar.
    shows_bar = not (to_terminal and output_format is not FormatChoice.TABLE)
    with (
        Interruption() as interruption,
        open_journal(output, options, resume=request.resume, overwrite=request.overwrite) or nullcontext() as journal,
    ):
        if journal is not None and journal.discarded:
            reporter.note(f"{journal.path}: was left by an unfinished run; without --resume the run starts again")
        if journal is not None and request.resume and journal.is_new:
            reporter.note(f"{journal.path}: there is nothing to resume; all images are measured anew")
        is_binary = output_format is FormatChoice.PARQUET
        with suppress(Unfinished), open_output(output, binary=is_binary, overwrite=request.overwrite) as handle:
            bar = reporter.running(total, shows_bar=shows_bar)
            measured = _measured(items, options, request, reporter, journal, total)
            with closing(follow(measured, reporter, bar, interruption)) as results:
                # Of a stream the targets are not known before its first image.
                first = list(islice(results, 1)) if total is None else []
                layout = layouts.choose()
                selection = _selection(request, output_format, layout)
                write_output(
                    _in_frame(chain(first, results), request, layout),
                    handle,
                    output_format=output_format,
                    layout=layout,
                    reference=reference,
                    selection=selection,
                )
            if interruption.received:
                # A part of the table must not take the place of a whole one.
                raise Unfinished
        is_done = not (interruption.received or reporter.lost)
        if journal is not None and journal.reused:
            reporter.note(f"{journal.reused} finished before")
        if journal is not None and is_done:
            journal.remove()
    reporter.notes(_closing_notes(None if interruption.received else output, skipped))
    reporter.summary(
        total,
        interrupted=interruption.received,
        resumable=journal is not None and not is_done,
        counted=request.known.count is not None,
    )
    if interruption.received:
        return INTERRUPTED
    if reporter.bugs:
        return BUG
    return SOME_FAILED if reporter.failures else 0


def _in_frame(results: Iterable[ImageResult], request: EstimateRequest, layout: Layout) -> Iterable[ImageResult]:
    """Return the results in the frame that is asked for."""
    # Distances and angles are the same in any, and better known without the errors of a board.
    return results if request.world_board is None or layout == "pairs" else map(relative_to_world, results)


def _closing_notes(written: Place | None, skipped: Counter[str]) -> Iterator[str]:
    if written is not None and is_file(written):
        yield f"{written}: written"
    if skipped:
        yield skipped_line(skipped)


def _selection(request: EstimateRequest, output_format: FormatChoice, *layouts: Layout) -> Selection:
    return choose_rows(request.columns, chosen_only=request.chosen_only, output_format=output_format, layouts=layouts)


def _measured(
    items: Iterable[WorkItem],
    options: MeasureOptions,
    request: EstimateRequest,
    reporter: Reporter,
    journal: Journal | None,
    total: int | None,
) -> Generator[ImageResult, None, None]:
    # A stream may be slow or endless: without workers a silent producer would hold back what is done.
    jobs = available_cores() if total is None and request.jobs is None else request.jobs
    measure = partial(measure_files, jobs=jobs)
    if request.cluster is not None:
        from circlepose.batch.cluster.run import measure_on_cluster  # noqa: PLC0415 - few ask for it

        measure = partial(measure_on_cluster, address=request.cluster, on_note=reporter.note)
    measure = partial(measure, options=options, timeout_s=request.timeout, on_bug=reporter.bug)
    return measure(items) if journal is None else measure_with_journal(items, journal, measure, reporter.note)


def _images(
    request: EstimateRequest, setups: Setups, outputs: Outputs, skipped: Counter[str], held: ExitStack
) -> tuple[Iterable[InputImage], int | None]:
    """Return the images and, unless they come as a stream, their number, once all have a setup."""
    stdin = (
        standard_input(
            sys.stdin.buffer, request.stdin, held, nul=request.nul, has_camera=request.known.calib is not None
        )
        if sys.stdin
        else None
    )
    images = _guarded(expand_inputs(request.inputs, stdin, request.recursive, skipped), outputs)
    if are_streamed(request.inputs):
        return images, None
    known = list(images)
    for image in known:
        setups.for_image(image.path)
    return known, len(known)


def _refuse_pictures(
    overlays: OverlayNames,
    output: Place | None,
    request: EstimateRequest,
    images: Iterable[InputImage],
    setups: Setups,
) -> None:
    """Raise `UsageError` where a picture would be written over a file that is read, or over the table."""
    pictures = Outputs(overlays.replaced)
    if overlays.replaced:
        for image in images:
            pictures.refuse(image.path, "an image to measure")
            setup = setups.for_image(image.path)
            pictures.refuse(setup.camera_file.path, "the calibration")
            pictures.refuse(setup.target_path, "the target")
            pictures.refuse(setup.world_path, "the world board")
    pictures.refuse(request.reference, "the reference")
    pictures.refuse(output, "the table of -o")
    if isinstance(output, Path) and output.suffix.lower() == ".png" and overlays.holds(output):
        raise UsageError(
            f"-o {output}, --overlay {request.overlay}: a picture in that folder may get this name; give the table "
            "another one."
        )


def _guarded(images: Iterable[InputImage], outputs: Outputs) -> Iterator[InputImage]:
    for image in images:
        outputs.refuse(image.path, "an image to measure")
        yield image


def _reference(request: EstimateRequest) -> Reference | None:
    if request.reference is None:
        return None
    if request.layout != "table2":
        raise UsageError("--reference: goes with --layout table2; circlepose check compares whole tables.")
    return read_reference(request.reference)


def _check_reference(reference: Reference | None, request: EstimateRequest, images: Iterable[InputImage]) -> None:
    if reference is None:
        return
    names = [image.name for image in images]
    if not any(reference.knows(name) for name in names):
        ours, theirs = names[0], next(iter(reference.by_image), "none")
        raise UsageError(
            f"--reference: {request.reference} has none of the images; it names {theirs}, they are {ours}."
        )


def _work_items(
    images: Iterable[InputImage], setups: Setups, overlays: OverlayNames | None, *, overwrite: bool
) -> Iterator[WorkItem]:
    for image in images:
        setup = setups.for_image(image.path)
        overlay = None if overlays is None else overlays.path_for(image)
        camera, target, world = setup.camera_file.camera, setup.target, setup.world_board
        yield WorkItem(image.path, image.name, camera, target, overlay, overwrite, world)


def _check_form(output_format: FormatChoice, request: EstimateRequest) -> None:
    """Raise `UsageError` where options do not go together, before any file is read."""
    if request.cluster is not None and request.jobs is not None:
        raise UsageError("--jobs, --cluster: give one of them; the cluster has its own number of workers.")
    if request.world_board is not None and request.layout is not None and not is_data_layout(request.layout):
        raise UsageError("--world-board: goes with --layout poses, boards or pairs.")
    possible: tuple[Layout, ...] = USUAL if request.layout is None else (request.layout,)
    _selection(request, output_format, *possible)
    if output_format is FormatChoice.PARQUET:
        from circlepose.io.tables.parquet import require_parquet  # noqa: PLC0415 - few ask for it

        if request.layout is not None and not is_data_layout(request.layout):
            raise UsageError("--format parquet: goes with --layout poses, boards or pairs.")
        require_parquet()


def _accept_setup(
    reporter: Reporter, outputs: Outputs, folder: Place, setup: Setup, method: str, layouts: LayoutChoice
) -> None:
    outputs.refuse(setup.camera_file.path, "the calibration")
    outputs.refuse(setup.target_path, "the target")
    outputs.refuse(setup.world_path, "the world board")
    try:
        methods_for(setup.target.kind, method)
    except ArgumentError as error:
        # The command line itself is no place to name.
        where = (
            "" if setup.target_path is None and setup.target_origin.startswith("--") else f"{setup.target_origin}: "
        )
        raise UsageError(f"{where}--{error}") from None
    reporter.expect(setup.target)
    layouts.accept(setup)
    for note in setup.notes:
        reporter.note(note)
    reporter.detail(f"{folder}: camera {setup.camera_file.path}, target {setup.target_origin}")
