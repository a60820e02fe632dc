"""Help in groups, with examples that hold."""

from __future__ import annotations

import re
import shlex

import pytest
import typer.main

from circlepose_cli.app import app, main
from circlepose_cli.commands.examples import EXAMPLES
from circlepose_cli.options.help import Group

COMMANDS = typer.main.get_command(app).commands
LARGE = ("estimate", "explain", "inspect", "check")


def sections(capsys, name):
    """The lines of each section of a command's help."""
    assert main([name, "--help"]) == 0
    parts = re.split(r"^(\S.*):$", capsys.readouterr().out, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize("name", LARGE)
def test_every_option_is_in_one_group(name, capsys):
    shown = sections(capsys, name)
    groups = [title for title in shown if title in set(Group)]
    assert list(shown) == ["Arguments", *groups, "Examples"]
    assert groups == [group for group in Group if group in groups]
    for parameter in COMMANDS[name].params:
        for option in parameter.opts:
            if option.startswith("--"):
                where = [title for title in groups if re.search(rf"{option}\b(?!-)", leads(shown[title]))]
                assert len(where) == 1, option


def leads(section):
    """What stands at the left of a section's lines: the options, not what is said of them."""
    return "\n".join(line for line in section.splitlines() if re.match(r"  -", line))


@pytest.mark.parametrize("name", LARGE)
def test_each_option_names_its_group(name):
    for parameter in COMMANDS[name].params:
        if parameter.param_type_name == "option" and parameter.name != "help":
            assert parameter.rich_help_panel in set(Group), parameter.name


@pytest.mark.parametrize("name", ["camera", "render", "statuses"])
def test_few_options_need_no_groups(name, capsys):
    assert set(Group).isdisjoint(sections(capsys, name))


def example_lines():
    return [(name, line) for name, text in EXAMPLES.items() for line in text.splitlines()]


@pytest.mark.parametrize(("name", "line"), example_lines())
def test_an_example_is_a_command_line_that_holds(name, line, capsys):
    assert line in sections(capsys, name)["Examples"]
    assert len(line) <= 77
    for part in re.split(r" \| | >>? \S+$", line):
        words = shlex.split(part)
        if words:
            assert words[0] == "circlepose"
            COMMANDS[words[1]].make_context(words[1], words[2:], resilient_parsing=False).close()


@pytest.mark.parametrize("option", ["-V", "--version"])
def test_the_version_has_a_short_option(option, capsys):
    assert main([option]) == 0
    assert re.fullmatch(r"circlepose \d+\.\d+\.\d+\S*\n", capsys.readouterr().out)
