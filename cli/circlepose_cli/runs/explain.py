"""`circlepose explain` at work: one image -> its report, and its picture where one is asked for."""

from __future__ import annotations

import sys
from dataclasses import asdict, replace

from circlepose.diagnostics.explain import explain
from circlepose.errors import UsageError
from circlepose.io.images.reader import read_image, write_image
from circlepose.io.inputs.images import STDIN, InputImage, expand_inputs
from circlepose.io.output_conflicts import Outputs
from circlepose.io.tables import json_records
from circlepose.io.text.escaping import printable
from circlepose.results import Status
from circlepose_cli.console.doubtful_radius import doubt
from circlepose_cli.console.terminal import fitted
from circlepose_cli.options.declared import ReportFormat
from circlepose_cli.options.parse import with_options_named
from circlepose_cli.options.requests import ExplainRequest
from circlepose_cli.options.setup import Setup, Setups
from circlepose_cli.output.destination import open_output
from circlepose_cli.reports.explain.boards import listed
from circlepose_cli.reports.explain.record import report_record
from circlepose_cli.reports.explain.text import INDENT, report_text

FAILED = 3


def run(request: ExplainRequest) -> int:
    """Explain the image that is asked for and return the exit code."""
    image = _one_image(request.image)
    setup = Setups(
        request.known,
        lambda _, setup: _print_notes(request, setup),
        force_calibration=request.stages.force_calibration,
    ).for_image(image.path)
    if request.circle is not None and request.circle not in setup.target.circle_names:
        names = listed(setup.target.circle_names)
        raise UsageError(f"--circle: expected a circle of the target ({names}), got {request.circle!r}.")
    outputs = Outputs([request.picture])
    outputs.refuse(image.path, "the image to explain")
    outputs.refuse(setup.camera_file.path, "the calibration")
    outputs.refuse(setup.target_path, "the target")
    camera = setup.camera_file.camera
    pixels = read_image(image.path)
    explanation = explain(pixels, camera, setup.target, **asdict(request.stages), name=image.name)
    explanation = replace(explanation, result=with_options_named(explanation.result))
    question = doubt(explanation.result)
    if question is not None and not request.quiet:
        print(printable(f"{image.name}: {question}"), file=sys.stderr)
    if request.picture is not None:
        from circlepose.drawing.explanation import draw_explanation  # noqa: PLC0415 - drawing is rarely asked for

        drawn = draw_explanation(pixels, explanation, camera, circle=request.circle)
        write_image(request.picture, drawn, drawn=True, overwrite=request.overwrite)
    with open_output(None) as handle:
        if request.report_format is ReportFormat.JSON:
            handle.write(json_records.dumps(report_record(explanation)) + "\n")
        else:
            report = report_text(explanation, f"{setup.camera_file.path}", setup.target_origin, request.circle)
            handle.write(fitted(report, handle, INDENT) + "\n")
    return 0 if explanation.result.status is Status.OK else FAILED


def _one_image(typed: str) -> InputImage:
    if typed == STDIN:
        raise UsageError("-: explain takes the name of one image; circlepose estimate measures many.")
    first, *others = list(expand_inputs([typed]))
    if others:
        raise UsageError(
            f"{typed}: explain takes one image, these are {len(others) + 1}; name one, such as {first.path}."
        )
    return first


def _print_notes(request: ExplainRequest, setup: Setup) -> None:
    if request.quiet:
        return
    for note in setup.notes:
        print(printable(note), file=sys.stderr)
