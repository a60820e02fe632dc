"""A comparison for GitHub Actions: annotations, which its log turns into remarks on the run, and a step summary."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

from circlepose.evaluation.compare import Comparison, Difference
from circlepose.io.tables.columns import fixed
from circlepose.io.text.escaping import printable, quoted

Level = Literal["error", "warning"]
_MOST_ANNOTATIONS = 10
"""GitHub shows no more of one level in a step."""
_MOST_ROWS = 200
"""A summary of more than 1 MiB is not shown; names of 4096 bytes fit."""


def workflow_commands(comparison: Comparison, level: Level) -> Iterator[str]:
    """Yield a workflow command for each difference, the worst first; the last one counts those left out."""
    differences = comparison.differences
    shown = differences if len(differences) <= _MOST_ANNOTATIONS else differences[: _MOST_ANNOTATIONS - 1]
    for each in shown:
        title = f"circlepose check - {each.change}"
        yield f"::{level} file={_property(quoted(each.image))},title={_property(title)}::{_message(_sentence(each))}"
    left_out = len(differences) - len(shown)
    if left_out:
        where = "the step summary, if there is one, and --format csv list them"
        yield f"::{level} title=circlepose check::{left_out} more differences; {where}"


def summary(comparison: Comparison, outcome: str) -> str:
    """Return the comparison as Markdown: the `outcome`, and a table of what differs."""
    lines = ["### circlepose check", "", _markdown(outcome), ""]
    differences = comparison.differences
    if differences:
        lines += [
            "| image | # | circle | method | change | tolerances | mm | deg | status |",
            "|---|---|---|---|---|--:|--:|--:|---|",
            *map(_row, differences[:_MOST_ROWS]),
            "",
        ]
    if len(differences) > _MOST_ROWS:
        lines += [f"{len(differences) - _MOST_ROWS} more differences are left out.", ""]
    return "\n".join(lines) + "\n"


def _sentence(difference: Difference) -> str:
    """Return what differs, in words."""
    names = (("target", difference.instance), ("circle", difference.circle), ("method", difference.method))
    where = ", ".join([quoted(difference.image), *(f"{what} {name}" for what, name in names if name is not None)])
    return f"{where}: {_finding(difference)}"


def _finding(difference: Difference) -> str:
    if difference.change == "missing":
        return f"missing in the poses; the reference has {difference.reference_status}"
    if difference.change == "extra":
        return f"not in the reference; the poses have {difference.status}"
    if difference.change == "status":
        return f"status {difference.status}, in the reference {difference.reference_status}"
    moved = " and ".join(
        f"{value:.3g} {unit}"
        for value, unit in (
            (difference.position_difference_mm, "mm"),
            (difference.orientation_difference_deg, "deg"),
        )
        if value is not None
    )
    times = difference.tolerances
    shown_times = "" if times is None or math.isinf(times) else f" ({times:.3g} tolerances)"
    flipped = "; the other candidate is within" if difference.change == "flipped" else ""
    return f"moved by {moved}{shown_times}{flipped}"


def _row(difference: Difference) -> str:
    numbers = (
        (difference.tolerances, 2),
        (difference.position_difference_mm, 3),
        (difference.orientation_difference_deg, 3),
    )
    names = (difference.image, difference.instance, difference.circle, difference.method, difference.change)
    status = f"{difference.reference_status or 'none'} -> {difference.status or 'none'}"
    cells = [
        *("" if name is None else _markdown(quoted(str(name))) for name in names),
        *("" if value is None else fixed(value, decimals) for value, decimals in numbers),
        "" if difference.status == difference.reference_status else _markdown(status),
    ]
    return f"| {' | '.join(cells)} |"


def _message(text: str) -> str:
    """Escape the message of a workflow command."""
    return printable(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    """Escape the value of a property of a workflow command."""
    return _message(text).replace(":", "%3A").replace(",", "%2C")


def _markdown(text: str) -> str:
    """Return `text` with all that Markdown or HTML would act on as character references."""
    return "".join(c if c.isalnum() or c in " .,/;-" else f"&#{ord(c)};" for c in printable(text))
