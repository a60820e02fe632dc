"""`circlepose camera --to` at work: a calibration of one form -> the same camera in another -> output."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import get_args

from circlepose.errors import UsageError
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.calibration.writers import WrittenForm
from circlepose.io.calibration.writers.conversion import convert
from circlepose.io.calibration.writers.registry import WRITERS
from circlepose.io.output_conflicts import Outputs
from circlepose.io.remote.images import Place, RemoteFile
from circlepose.io.text.escaping import printable
from circlepose_cli.options.declared import ReportFormat
from circlepose_cli.output.destination import open_output, output_place

_OF_NO_FORM = {".bin", ".toml", ".ini", ".csv", ".npz", ".npy", ".mat", ".gz", ".png", ".jpg"}
"""endings that promise what none of the forms is"""


@dataclass(frozen=True, slots=True)
class ConvertRequest:
    """What is typed after `circlepose camera` where it writes a calibration."""

    calibration: Path
    camera_name: str | None
    to: WrittenForm | None
    output: str | None
    overwrite: bool
    target_file: Path | None
    report_format: ReportFormat


def run(request: ConvertRequest) -> None:
    """Convert, write, and say what was converted and what is left out."""
    to = _checked(request)
    output = output_place(request.output)
    ending = _ending(output, to)
    Outputs([output]).refuse(request.calibration, "the calibration to convert")
    camera_file = read_camera_file(request.calibration, request.camera_name)
    conversion = convert(camera_file, to, ending)
    with open_output(output, overwrite=request.overwrite) as handle:
        handle.write(conversion.text)
    for note in camera_file.notes:
        _say(f"note: {note}")
    for doubt in camera_file.doubts:
        _say(f"warning: {doubt.about}: {doubt.text}")
    for remark in conversion.remarks:
        _say(f"note: {remark}")
    if output is not None:
        name = str(output)
        _say(f"{name}: {conversion.form}, {conversion.lens}; to see it: circlepose camera {shlex.quote(name)}")


def _checked(request: ConvertRequest) -> WrittenForm:
    """Return the form to convert to; raises `UsageError` on options that do not go together."""
    if request.to is None:
        option = "-o" if request.output is not None else "--overwrite"
        raise UsageError(
            f"{option}: needs --to {'|'.join(get_args(WrittenForm))}, the form of the calibration to write; the "
            "report goes to standard output."
        )
    if request.report_format is not ReportFormat.TEXT:
        raise UsageError(
            f"--format {request.report_format}: is of the report, and --to writes a calibration instead; leave one "
            "of them out."
        )
    if request.target_file is not None:
        raise UsageError("--target: is for the report, and --to writes a calibration instead; leave one of them out.")
    if request.overwrite and request.output is None:
        raise UsageError("--overwrite: needs -o FILE, the file to replace.")
    return request.to


def _ending(output: Place | None, to: WrittenForm) -> str:
    """Return the ending of the output's name; raises `UsageError` on one that promises another form."""
    if output is None:
        return ""
    path = output.url.partition("?")[0] if isinstance(output, RemoteFile) else str(output)
    suffixes = [each.lower() for each in PurePosixPath(path).suffixes]
    ending = "".join(suffixes[-2:]) if suffixes[-1:] == [".gz"] else "".join(suffixes[-1:])
    writer = WRITERS[to]
    others = {each for other in WRITERS.values() for each in other.endings} | _OF_NO_FORM
    if ending not in writer.endings and (ending in others or suffixes[-1:] == [".gz"]):
        raise UsageError(f"-o {path}: {writer.name} is written as {' or '.join(writer.endings)}, not {ending}.")
    return ending


def _say(line: str) -> None:
    print(printable(line), file=sys.stderr)
