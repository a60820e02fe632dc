"""The command as a process: pipes, signals, start-up. Few, as each costs a start."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from discs import disc_folder

COMMAND = [sys.executable, "-c", "import sys; from circlepose_cli.app import main; sys.exit(main())"]


def run(*args, **options):
    return subprocess.run(
        [*COMMAND, *map(str, args)], capture_output=True, text=True, timeout=60, check=False, **options
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return disc_folder(tmp_path_factory.mktemp("process") / "imgs")


@pytest.mark.parametrize("args", [["--help"], ["--version"], ["estimate", "--help"]])
def test_help_and_version_import_nothing_heavy(args):
    code = (
        "import sys; from circlepose_cli.app import main; code = main(sys.argv[1:]); "
        "print(*sys.modules, file=sys.stderr); sys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code, *args], capture_output=True, text=True, timeout=60, check=True)
    heavy = {"numpy", "cv2", "scipy", "pydantic", "rich", "yaml"}
    assert heavy.isdisjoint(done.stderr.split())
    assert done.stdout


def test_a_pipe_gets_csv_and_nothing_else(folder):
    done = run("estimate", folder)
    assert done.returncode == 0
    assert done.stdout.startswith("image,instance,circle,")
    assert "\x1b" not in done.stdout + done.stderr
    assert done.stderr == "2 measured, 0 failed\n"


def test_paths_on_standard_input(folder):
    names = "".join(f"{path}\n" for path in (*sorted(folder.glob("*.png")), folder / "gone.png"))
    done = run("estimate", "-", "--format", "jsonl", input=names)
    assert done.returncode == 3
    assert [json.loads(line)["status"] for line in done.stdout.splitlines()] == ["ok", "ok", "unreadable"]


def test_a_reader_that_goes_away_is_no_failure(folder):
    with subprocess.Popen(
        [*COMMAND, "estimate", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout.readline().startswith("image,")
        process.stdout.close()
        assert (process.wait(timeout=60), process.stderr.read()) == (0, "")


SLOW = """
import sys, time
from circlepose.batch import local
from circlepose_cli.app import main
measure = local.measure_file
def measure_or_wait(item, options):
    if item.name.endswith("disc0.png"):
        return measure(item, options)
    print("waiting", file=sys.stderr, flush=True)
    time.sleep(60)
local.measure_file = measure_or_wait
sys.exit(main())
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_keeps_its_rows_and_counts_the_rest(folder, number):
    with subprocess.Popen(
        [sys.executable, "-c", SLOW, "estimate", "--jobs", "1", "--format", "json", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr.readline() == "waiting\n"
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert [image["image"] for image in json.loads(out)["images"]] == ["disc0.png"]
    assert err == "1 measured, 0 failed, interrupted: 1 not done\n"


def test_a_full_disk_is_told(folder):
    if not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full here")
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*COMMAND, "estimate", str(folder)],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            check=False,
        )
    assert done.returncode == 2
    assert "standard output: No space left on device." in done.stderr


def in_terminal(command, environment):
    """Run in a pseudo-terminal and return what it shows."""
    pty = pytest.importorskip("pty")
    leader, follower = pty.openpty()
    with subprocess.Popen(command, stdin=follower, stdout=follower, stderr=follower, env=environment) as process:
        os.close(follower)
        shown = b""
        while True:
            try:
                part = os.read(leader, 4096)
            except OSError:
                break
            if not part:
                break
            shown += part
        os.close(leader)
        assert process.wait(timeout=60) == 0
    return shown.decode()


def test_a_terminal_gets_a_table_and_a_bar_and_no_colour_is_respected(folder):
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "140"}
    environment.pop("NO_COLOR", None)
    shown = in_terminal([*COMMAND, "estimate", str(folder)], environment)
    assert "ambiguity" in shown
    assert "measuring" in shown
    coloured = "\x1b[3"
    assert coloured in shown
    assert coloured not in in_terminal([*COMMAND, "estimate", str(folder)], {**environment, "NO_COLOR": "1"})
