"""The command as a process of its own, in a shell like a user's."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys

import pytest

from tests.support.json_outputs import assert_valid

SETTLE = "either pose may be the right one; give --facing, --normal or --up, or a target of two circles"
"""what is said where lone circles are ambiguous"""
GO_ON = "with -o FILE, an interrupted run can be continued with --resume\n"
"""what is said where a run to standard output is interrupted"""
COMMAND = [sys.executable, "-m", "circlepose"]
SLOW = """
import sys, time
from circlepose.batch import measure as local
measure = local.measure_file
def measure_or_wait(item, options):
    if item.name.endswith("disc0.png"):
        return measure(item, options)
    print("waiting", file=sys.stderr, flush=True)
    # Not in one piece: a signal on the way into a sleep does not end it.
    for _ in range(600):
        time.sleep(0.1)
local.measure_file = measure_or_wait
from circlepose_cli.entry import main
sys.exit(main())
"""
"""The command, as a program for `python -c`, that says so and waits at every image but `disc0.png`."""


def environment(**more: str) -> dict[str, str]:
    """Return the environment of this process, without what hides how streams are buffered."""
    return {**{name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}, **more}


def run(*args, **options):
    """Run the command line `args` and return the process that has ended, with its streams as text."""
    options = {"env": environment(), "timeout": 120, **options}
    done = subprocess.run([*COMMAND, *map(str, args)], capture_output=True, text=True, check=False, **options)
    assert_valid(done.stdout)
    return done


def shell(line, *args, **options):
    """Run `line` by bash, in which $circlepose is the command and $1, $2, ... are `args`."""
    if not os.path.exists("/bin/bash"):  # noqa: PTH110
        pytest.skip("there is no bash here")
    options = {"env": environment(circlepose=shlex.join(COMMAND)), "timeout": 120, **options}
    command = ["/bin/bash", "-c", line, "bash", *map(str, args)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert_valid(done.stdout, may_be_cut=True)
    return done
