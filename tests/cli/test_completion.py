"""What shells are given, and what they are answered."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from circlepose.io.tables import LAYOUTS
from circlepose.solvers import METHODS
from circlepose_cli.commands.completion import REQUEST, Shell
from tests.support.processes import COMMAND, environment, run, shell


@pytest.mark.parametrize("name", Shell)
def test_each_shell_has_a_script_that_it_can_read(name, tmp_path):
    done = run("completion", name)
    assert done.returncode == 0
    assert f"{REQUEST}=complete_{name}" in done.stdout
    assert "circlepose" in done.stdout
    if shutil.which(name):
        (tmp_path / "script").write_text(done.stdout)
        subprocess.run([name, "-n", tmp_path / "script"], check=True)


def test_another_shell_is_refused_with_those_there_are():
    done = run("completion", "tcsh")
    assert done.returncode == 2
    assert all(name in done.stderr for name in Shell)


def answer(line, name="bash"):
    """The completions of the last word of `line`."""
    words = line.split(" ")
    asked = {
        REQUEST: f"complete_{name}",
        "COMP_WORDS": line,
        "COMP_CWORD": str(len(words) - 1),
        "_TYPER_COMPLETE_ARGS": line,
        "_TYPER_COMPLETE_FISH_ACTION": "get-args",
    }
    done = subprocess.run(COMMAND, env=environment(**asked), capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_commands_options_and_choices_complete():
    assert answer("circlepose est").split() == ["estimate"]
    assert answer("circlepose estimate --me").split() == ["--method"]
    assert answer("circlepose estimate --method ").split() == [*METHODS, "all"]
    assert answer("circlepose estimate --layout ").split() == list(LAYOUTS)
    assert answer("circlepose estimate --calib ").split() == []  # files, which the shell knows itself


@pytest.mark.parametrize("name", ["zsh", "fish"])
def test_other_shells_get_the_help_as_well(name):
    shown = answer("circlepose estimate --me", name)
    assert "--method" in shown
    assert "How the candidate poses are computed" in shown


def test_bash_completes_by_the_script(tmp_path):
    done = shell(
        'eval "$($circlepose completion bash)"; printf \'#!/bin/sh\\nexec %s "$@"\' "$circlepose" > "$1/circlepose"; '
        'chmod +x "$1/circlepose"; COMP_WORDS=(circlepose estimate --me); COMP_CWORD=2; '
        '_circlepose_completion "$1/circlepose"; echo "${COMPREPLY[@]}"',
        tmp_path,
    )
    assert (done.stdout, done.stderr) == ("--method\n", "")


def test_a_request_imports_nothing_heavy():
    code = (
        "import sys; from circlepose_cli.app import main; code = main([]); "
        "print(*sys.modules, file=sys.stderr); sys.exit(code)"
    )
    asked = {REQUEST: "complete_bash", "COMP_WORDS": "circlepose estimate --format ", "COMP_CWORD": "3"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(**asked), capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.split()[0] == "csv"
    assert {"numpy", "cv2", "scipy", "yaml"}.isdisjoint(done.stderr.split())
