"""`circlepose check` at work: two tables -> their comparison -> output, and the exit code."""

from __future__ import annotations

import os
import sys
from collections import Counter
from pathlib import Path

from circlepose.errors import ArgumentError, UsageError
from circlepose.evaluation.compare import CHANGE_MEANING, Comparison, Tolerance, compare
from circlepose.evaluation.matching import PoseTable
from circlepose.io.inputs.images import STDIN
from circlepose.io.output_conflicts import Outputs
from circlepose.io.tables.reader import PoseFile, read_pose_file
from circlepose.io.text.escaping import printable
from circlepose.io.text.source import MAX_TABLE_BYTES, open_at_once, read_regular
from circlepose_cli.options.declared import CheckFormat, FormatChoice
from circlepose_cli.options.requests import CheckRequest
from circlepose_cli.output.destination import open_output
from circlepose_cli.output.results import choose_format
from circlepose_cli.reports.check import write_comparison
from circlepose_cli.reports.github import Level, summary, workflow_commands

OUTSIDE_TOLERANCE = 4
STEP_SUMMARY = "GITHUB_STEP_SUMMARY"


def run(request: CheckRequest) -> int:
    """Compare, print what differs, and return the exit code."""
    tolerance = _tolerance(request)
    poses = 0 if request.poses == STDIN else Path(request.poses)
    if request.update:
        Outputs([request.against]).refuse(poses, "the poses")
    appended = Outputs([_step_summary(request)])
    appended.refuse(poses, "the poses")
    appended.refuse(request.against, "the reference")
    measured = _read_poses(request.poses)
    if request.update and not request.against.exists():
        _update(measured, request)
        return 0
    content = read_regular(str(request.against), UsageError, MAX_TABLE_BYTES)
    reference = read_pose_file(content, str(request.against), truth_allowed=True, beside=measured.table)
    if request.update:
        _refuse_update(measured, reference)
    if measured.table.of_boards != reference.table.of_boards:
        ours, theirs = ("boards", "circles") if measured.table.of_boards else ("circles", "boards")
        raise UsageError(
            f"--against: {reference.name} is of {theirs}, {measured.name} of {ours}; make both by one --layout."
        )
    comparison = compare(measured.table, reference.table, tolerance, request.candidate)
    outcome = _summary(comparison, tolerance, measured.table)
    if request.output_format is CheckFormat.GITHUB:
        _write_for_github(comparison, outcome, request)
    else:
        write_comparison(comparison, tolerance, sys.stdout, _output_format(request))
    for note in comparison.notes:
        _note(note, request)
    _note(outcome, request)
    if request.update:
        _update(measured, request)
        return 0
    return OUTSIDE_TOLERANCE if comparison.differences else 0


def _output_format(request: CheckRequest) -> FormatChoice:
    asked = None if request.output_format is None else FormatChoice(request.output_format)
    return choose_format(asked, None, to_terminal=sys.stdout.isatty(), of_estimate=False)


def _step_summary(request: CheckRequest) -> Path | None:
    """Return the file to which GitHub Actions wants a summary appended; None elsewhere."""
    path = os.environ.get(STEP_SUMMARY)
    return Path(path) if path and request.output_format is CheckFormat.GITHUB else None


def _write_for_github(comparison: Comparison, outcome: str, request: CheckRequest) -> None:
    """Print annotations, and append to the summary of the step where the environment names its file."""
    level: Level = "warning" if request.update else "error"
    for command in workflow_commands(comparison, level):
        print(command)
    path = _step_summary(request)
    if path is None:
        return
    try:
        # A pipe would be waited for.
        with open(path, "a", encoding="utf-8", opener=open_at_once) as handle:
            handle.write(summary(comparison, outcome))
    except (OSError, ValueError) as error:
        # The verdict on the poses stands without it.
        reason = getattr(error, "strerror", None) or error
        _note(f"{STEP_SUMMARY}: {path} cannot be written ({reason}); there is no step summary", request)


def _tolerance(request: CheckRequest) -> Tolerance:
    try:
        return Tolerance(request.position_mm, request.normal_deg)
    except ArgumentError as error:
        raise UsageError(f"--{str(error).replace('_', '-', 1)}") from None


def _read_poses(poses: str) -> PoseFile:
    if poses != STDIN:
        return read_pose_file(read_regular(poses, UsageError, MAX_TABLE_BYTES), poses)
    if sys.stdin is None:
        raise UsageError("-: there is no standard input to read poses from.")
    content = sys.stdin.buffer.read(MAX_TABLE_BYTES + 1)
    if len(content) > MAX_TABLE_BYTES:
        raise UsageError(f"standard input: is larger than {MAX_TABLE_BYTES // 1_000_000} MB, the most that is read.")
    return read_pose_file(content, "standard input")


def _refuse_update(measured: PoseFile, reference: PoseFile) -> None:
    if reference.table.is_truth:
        raise UsageError(
            f"--update: {reference.name} is a truth, without the columns method and solution, and is never "
            "overwritten; name a baseline."
        )
    if measured.form != reference.form:
        raise UsageError(
            f"--update: {reference.name} is {reference.form} and {measured.name} is {measured.form}; make the "
            f"poses with --format {reference.form}, or remove the baseline first."
        )


def _update(measured: PoseFile, request: CheckRequest) -> None:
    # The baseline was read as a table of poses, whatever wrote it.
    with open_output(request.against, binary=True, overwrite=True) as handle:
        handle.write(measured.content)
    _note(
        f"{request.against}: now holds {_counted(len(measured.table.circles), measured.table)} of {measured.name}",
        request,
    )


def _summary(comparison: Comparison, tolerance: Tolerance, measured: PoseTable) -> str:
    limits = f"{tolerance.position_mm:g} mm and {tolerance.normal_deg:g} deg"
    parts = [f"{_counted(comparison.compared, measured)} compared"]
    counts = Counter(difference.change for difference in comparison.differences)
    if counts:
        kinds = ", ".join(f"{counts[change]} {change}" for change in CHANGE_MEANING if counts[change])
        parts.append(f"outside {limits}: {kinds}")
    else:
        parts.append(f"all within {limits}")
    largest = [
        f"{value:.3g} {unit}"
        for value, unit in ((comparison.largest_position_mm, "mm"), (comparison.largest_normal_deg, "deg"))
        if value is not None
    ]
    if largest:
        parts.append(f"largest difference {', '.join(largest)}")
    return "; ".join(parts)


def _counted(number: int, table: PoseTable) -> str:
    return f"{number} {'board' if table.of_boards else 'circle'}{'' if number == 1 else 's'}"


def _note(message: str, request: CheckRequest) -> None:
    if not request.quiet:
        print(printable(message), file=sys.stderr)
