"""`circlepose print` at work: a target file -> its sheets, the target beside them, and what to type next."""

from __future__ import annotations

import shlex
import sys

from circlepose.errors import UsageError
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.output_conflicts import Outputs
from circlepose.io.sheet_files import Printed, PrintOptions, print_drawn, print_target, require_form
from circlepose.io.text.escaping import printable, quoted
from circlepose.sheets.paper import paper_mm
from circlepose_cli.console.following import followed
from circlepose_cli.options.requests import PrintRequest

_FURNITURE_MM = (36.0, 72.0)
"""Width and height of a page beside the circles: margins, bars, small print and code."""


def run(request: PrintRequest) -> int:
    """Print the target that is asked for and return the exit code."""
    options = PrintOptions(
        None if request.paper is None else paper_mm(request.paper),
        request.is_dark_on_light,
        request.copies,
        marks=request.marks,
        code=request.code,
        overwrite=request.overwrite,
    )
    printed = _suggested(request, options) if request.suggest else _printed(request, options)
    for path in (*printed.sheets, printed.target_file):
        print(quoted(str(path)))
    if not request.quiet:
        for line in (*printed.remarks, *_next(printed)):
            print(printable(line), file=sys.stderr)
    return 0


def _printed(request: PrintRequest, options: PrintOptions) -> Printed:
    if request.calib is not None or request.distance_mm is not None:
        raise UsageError("--calib, --distance-mm: go with --suggest; a target file is printed as it is.")
    if request.target is None:
        raise UsageError("TARGET.yaml: is missing; give the target file to print, or --suggest.")
    return print_target(request.target, request.output, options)


def _suggested(request: PrintRequest, options: PrintOptions) -> Printed:
    """Print the board that is predicted to measure best, and say why."""
    from circlepose.planning.suggest import MOST_PROPOSALS, best_of, proposals, why  # noqa: PLC0415 - few ask for it

    if request.target is not None:
        raise UsageError("TARGET.yaml, --suggest: give one of them.")
    if request.calib is None or request.distance_mm is None or options.paper_mm is None:
        raise UsageError("--suggest: needs --calib FILE, --distance-mm A:B and --paper SIZE.")
    if not request.distance_mm[0] > 0.0:
        raise UsageError("--distance-mm: expected distances above 0.")
    require_form(request.output)
    camera = read_camera_file(request.calib, request.camera_name).camera
    if camera.image_size is None:
        raise UsageError(f"{request.calib}: states no image size; write image_size into it.")
    Outputs([request.output, request.output.with_suffix(".yaml")]).refuse(request.calib, "the calibration")
    width, height = options.paper_mm
    field = (width - _FURNITURE_MM[0], height - _FURNITURE_MM[1])
    tried = list(followed(proposals(camera, request.distance_mm, field), MOST_PROPOSALS, "predicting"))
    best = best_of(tried)
    if not request.quiet:
        for line in why(best, tried, request.distance_mm):
            print(printable(line), file=sys.stderr)
    return print_drawn(best.target, request.output, options, name="suggested board")


def _next(printed: Printed) -> list[str]:
    """Return what to do with the sheets, and what to type."""
    target = str(printed.target_file)
    shown = shlex.quote(f"./{target}" if target.startswith("-") else target)
    sheets = "the sheet" if printed.pages == 1 else f"the {printed.pages} sheets"
    return [
        f"Print {sheets} at 100 % (actual size), measure both bars, state print_scale in {target}; then:",
        f"  circlepose estimate photos/ --calib cam.yaml --target {shown}",
    ]
