"""`circlepose print` at work: a target file -> its sheets, the target beside them, and what to type next."""

from __future__ import annotations

import shlex
import sys

from circlepose.io.sheet_files import Printed, PrintOptions, print_target
from circlepose.io.text.escaping import printable, quoted
from circlepose.sheets.paper import paper_mm
from circlepose_cli.options.requests import PrintRequest


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
    printed = print_target(request.target, request.output, options)
    for path in (*printed.sheets, printed.target_file):
        print(quoted(str(path)))
    if not request.quiet:
        for line in (*printed.remarks, *_next(printed)):
            print(printable(line), file=sys.stderr)
    return 0


def _next(printed: Printed) -> list[str]:
    """Return what to do with the sheets, and what to type."""
    target = str(printed.target_file)
    shown = shlex.quote(f"./{target}" if target.startswith("-") else target)
    sheets = "the sheet" if printed.pages == 1 else f"the {printed.pages} sheets"
    return [
        f"Print {sheets} at 100 % (actual size), measure both bars, state print_scale in {target}; then:",
        f"  circlepose estimate photos/ --calib cam.yaml --target {shown}",
    ]
