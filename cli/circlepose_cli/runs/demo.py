"""`circlepose demo` at work: a rendered scene -> its folder -> poses, overlay, and what to type next."""

from __future__ import annotations

import os
import shlex
import stat
import sys
from importlib.resources import as_file, files
from pathlib import Path

from circlepose.batch.measure import MeasureOptions, WorkItem, measure_file
from circlepose.errors import OutputError, UsageError
from circlepose.io.calibration.reader import read_camera
from circlepose.io.marks import bears_mark
from circlepose.io.scenes.produce import render_to_folder
from circlepose.io.target_file import read_target
from circlepose.io.text.escaping import printable
from circlepose.results import ImageResult, Status
from circlepose_cli.options.declared import FormatChoice
from circlepose_cli.output.destination import open_output
from circlepose_cli.output.results import write_output

_PHOTO = "photo.png"
_TRUTH = "truth.csv"
_FILES = (_PHOTO, "camera.yml", "target.yaml", _TRUTH)
_OVERLAY = "overlay"
_BUG = 1
_TWO_POSES = (
    "A circle seen at an angle has two poses that fit its image equally well: which of the two rows of a disc is\n"
    "right is a coin flip (ambiguity 0.5). A second circle settles it, in the same plane, as a ring or on the same\n"
    "axis; so does a hint, such as --normal, --up or --facing."
)


def run(folder: Path) -> int:
    """Make the demo's folder, measure what is in it, and return the exit code."""
    if str(folder).startswith("-"):
        # The commands that are printed would take it for an option, or for standard input.
        folder = Path.cwd() / folder
    _check_folder(folder)
    with as_file(files("circlepose.io.scenes") / "demo.yaml") as scene:
        written = render_to_folder(scene, folder)
    result = _measured(folder)
    _say(f"{folder}: a rendered photograph of two discs of radius 30 mm on one plate, in")
    _say(f"  {', '.join(path.name for path in written)}")
    with open_output(None) as handle:
        write_output([result], handle, output_format=FormatChoice.TABLE, layout="poses")
    _say(_TWO_POSES)
    _say("")
    for purpose, command in _next_commands(folder):
        _say(f"{purpose}:\n  {command}")
    return 0 if result.status is Status.OK else _BUG


def _check_folder(folder: Path) -> None:
    """Raise `UsageError` where `folder` holds what no demo wrote, or leads elsewhere."""
    try:
        names = sorted(entry.name for entry in folder.iterdir() if not entry.name.startswith("."))
    except FileNotFoundError:
        return
    except OSError as reason:
        raise OutputError(f"{folder}: cannot be made a folder ({reason.strerror}).") from None
    if names and not _is_empty_or_ours(folder / _PHOTO) and not set(names) <= {*_FILES, _OVERLAY}:
        raise UsageError(
            f"{folder}: is not empty (it holds {names[0]}) and no demo was written there; name another folder."
        )
    if (folder / _OVERLAY).is_symlink():
        raise UsageError(f"{folder / _OVERLAY}: is a link, which the demo does not follow; name another folder.")
    for path in (*(folder / name for name in _FILES), folder / _OVERLAY / _PHOTO):
        if os.path.lexists(path) and not _is_empty_or_ours(path):
            raise UsageError(f"{path}: is no file of a demo; move it away, or name another folder.")


def _is_empty_or_ours(path: Path) -> bool:
    """Return whether a regular file, not a link to one, is empty or bears our mark."""
    try:
        status = path.lstat()
        return stat.S_ISREG(status.st_mode) and (status.st_size == 0 or bears_mark(path))
    except OSError:
        return False


def _measured(folder: Path) -> ImageResult:
    overlays = folder / _OVERLAY
    try:
        overlays.mkdir(exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{overlays}: cannot be made a folder ({reason.strerror}).") from None
    item = WorkItem(
        folder / _PHOTO,
        str(folder / _PHOTO),
        read_camera(folder / "camera.yml"),
        read_target(folder / "target.yaml"),
        overlays / _PHOTO,
    )
    return measure_file(item, MeasureOptions())


def _next_commands(folder: Path) -> list[tuple[str, str]]:
    """Return what each command does and how it is typed."""
    shown = shlex.quote(str(folder))
    photo = shlex.quote(str(folder / _PHOTO))
    truth = shlex.quote(str(folder / _TRUTH))
    return [
        ("Look at the poses drawn over the image", shlex.quote(str(folder / _OVERLAY / _PHOTO))),
        ("Settle the two poses (both discs lie in one plane)", f"circlepose estimate {shown} --coplanar"),
        (
            "Compare with the true poses",
            f"circlepose estimate {shown} --coplanar | circlepose check - --against {truth}",
        ),
        ("See what a pose rests on", f"circlepose explain {photo} --count all --coplanar"),
        ("Measure your own photographs", "circlepose estimate IMAGES --calib CAMERA --radius-mm R --overlay checked"),
    ]


def _say(line: str) -> None:
    print("\n".join(printable(each) for each in line.split("\n")), file=sys.stderr)
