"""Help in groups of options with examples below, as plain text so that it is there at once."""

from __future__ import annotations

from enum import StrEnum
from typing import Any

from typer.core import TyperCommand

_FEW = 8
"""up to which options need no groups"""


class Group(StrEnum):
    """Groups of options, in the order of the help; an option names its own as `rich_help_panel`."""

    INPUT = "Input"
    CAMERA = "Camera"
    TARGET = "Target"
    VIEW = "View"
    IMAGE = "Image"
    WANTED = "Wanted accuracy"
    DETECTION = "Detection"
    AMBIGUITY = "Poses and their ambiguity"
    COMPARISON = "Comparison"
    OUTPUT = "Output"
    RUNNING = "Running"


class GroupedCommand(TyperCommand):
    """A command whose plain help has a section for each group of options."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the arguments, then the groups."""
        records = {parameter: parameter.get_help_record(ctx) for parameter in self.get_params(ctx)}
        options = [each for each, record in records.items() if record and each.param_type_name == "option"]
        sections: dict[str, list[Any]] = {"Arguments": [each for each in records if each not in options]}
        if len(options) <= _FEW:
            sections["Options"] = options
        else:
            sections |= {group: [each for each in options if _group(each) == group] for group in Group}
        for title, parameters in sections.items():
            lines = [record for each in parameters if (record := records[each]) is not None]
            if lines:
                with formatter.section(str(title)):
                    formatter.write_dl(lines)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 - the signature is Typer's
        """Write the examples, a line each."""
        if self.epilog:
            with formatter.section("Examples"):
                for line in self.epilog.splitlines():
                    formatter.write(f"{' ' * formatter.current_indent}{line}\n")


def _group(option: Any) -> str:
    # Typer's own --help has none.
    return getattr(option, "rich_help_panel", None) or Group.RUNNING
