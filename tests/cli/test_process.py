"""The command as a process: pipes, signals, start-up. Few, as each costs a start."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.discs import disc_folder, found_notes
from tests.support.processes import COMMAND, GO_ON, SETTLE, SLOW, environment, run


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


def test_measuring_imports_no_library_that_it_does_not_use(folder):
    code = "import sys; from circlepose_cli.app import main; main(sys.argv[1:]); print(*sys.modules, file=sys.stderr)"
    args = [sys.executable, "-c", code, "estimate", "-q", str(folder / "disc0.png")]
    done = subprocess.run(args, capture_output=True, text=True, timeout=60, check=True)
    assert {"scipy", "matplotlib", "fsspec", "distributed"}.isdisjoint(done.stderr.split())


def test_a_pipe_gets_csv_and_nothing_else(folder):
    done = run("estimate", folder)
    assert done.returncode == 0
    assert done.stdout.startswith("image,instance,circle,")
    assert "\x1b" not in done.stdout + done.stderr
    assert done.stderr == f"{found_notes(folder)}2 measured, 0 failed, 2 ambiguous: {SETTLE}\n"


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
        env=environment(),
    ) as process:
        assert process.stdout.readline().startswith("image,")
        process.stdout.close()
        assert (process.wait(timeout=60), process.stderr.read()) == (0, found_notes(folder))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_keeps_its_rows_and_counts_the_rest(folder, number):
    with subprocess.Popen(
        [sys.executable, "-c", SLOW, "estimate", "--format", "json", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    ) as process:
        assert "".join(process.stderr.readline() for _ in range(3)) == found_notes(folder) + "waiting\n"
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert [image["image"] for image in json.loads(out)["images"]] == ["disc0.png"]
    assert err == f"1 measured, 0 failed, interrupted: 1 not done, 1 ambiguous: {SETTLE}\n{GO_ON}"


@contextmanager
def stream(*args):
    """A run that waits for paths on its standard input, in a process group of its own."""
    with subprocess.Popen(
        [*COMMAND, "estimate", "-", "--format", "jsonl", *args],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        bufsize=1,
        env=environment(),
        start_new_session=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def test_a_row_leaves_though_the_producer_is_silent_and_ctrl_c_ends_the_wait(folder):
    with stream("--jobs", "2") as process:
        for number in range(2):
            print(folder / f"disc{number}.png", file=process.stdin)
            assert json.loads(process.stdout.readline())["status"] == "ok"
        # As a terminal does: to the workers, too.
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert err.endswith(f"2 measured, 0 failed, interrupted: the rest not done, 2 ambiguous: {SETTLE}\n{GO_ON}")


def test_a_stream_whose_reader_goes_away_ends_at_the_next_row(folder):
    with stream() as process:
        print(folder / "disc0.png", file=process.stdin)
        assert process.stdout.readline()
        process.stdout.close()
        print(folder / "disc1.png", file=process.stdin)
        assert (process.wait(timeout=60), process.stderr.read()) == (0, found_notes(folder))


def workers_of(process):
    return Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()


def test_a_run_that_was_killed_and_resumed_writes_what_an_undisturbed_one_does(tmp_path):
    if not Path("/proc/self/task").exists():
        pytest.skip("children are found in /proc")
    folder = disc_folder(tmp_path / "imgs", images=8)
    (folder / "disc5.png").write_bytes(b"no image")
    whole, out, journal = (tmp_path / name for name in ("whole.csv", "out.csv", "out.csv.journal"))
    assert run("estimate", folder, "-o", whole).returncode == 3
    command = [*COMMAND, "estimate", str(folder), "--jobs", "2", "-o", str(out)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        while not (journal.exists() and journal.read_bytes().count(b"\n") > 3):
            assert process.poll() is None
            time.sleep(0.01)
        process.kill()
    assert not out.exists()
    with subprocess.Popen([*command, "--resume"], stderr=subprocess.PIPE, text=True) as process:
        # The first child keeps track of resources, the others work.
        while len(workers_of(process)) < 2:
            assert process.poll() is None
            time.sleep(0.01)
        os.kill(int(workers_of(process)[-1]), signal.SIGKILL)
        _, err = process.communicate(timeout=60)
    assert (process.returncode, err.splitlines()[-1]) == (
        3,
        f"7 measured, 1 failed (not_an_image 1), 7 ambiguous: {SETTLE}",
    )
    assert out.read_bytes() == whole.read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {"imgs", "out.csv", "whole.csv"}


def test_an_image_that_takes_too_long_is_a_row(folder, tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, (3000, 4000), np.uint8)
    cv2.imwrite(str(tmp_path / "noise.png"), noise)
    done = run(
        "estimate", tmp_path / "noise.png", "--calib", folder / "camera.yaml", "--radius-mm", 5, "--timeout", 0.01
    )
    assert done.returncode == 3
    assert "noise.png,,,,,,timed_out," in done.stdout
    assert "noise.png: was not measured within 0.01 s\n" in done.stderr


def test_a_disk_that_fills_up_leaves_the_output_as_it_was_and_what_is_finished(folder, tmp_path):
    resource = pytest.importorskip("resource")
    out, journal = tmp_path / "out.csv", tmp_path / "out.csv.journal"
    assert run("estimate", folder / "disc0.png", "-o", out).returncode == 0
    before = out.read_bytes()
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2500, 2500))  # noqa: E731
    done = run("estimate", folder, "-o", out, preexec_fn=limit)
    assert (done.returncode, done.stdout) == (2, "")
    message = done.stderr.removeprefix(found_notes(folder))
    assert message.startswith(f"circlepose: {journal}: cannot be written (File too large); it keeps")
    assert message.count("\n") == 1
    assert out.read_bytes() == before
    assert run("estimate", folder, "-o", out, "--resume").returncode == 0
    assert out.read_text().count("\ndisc") == 4
    assert not journal.exists()


def in_terminal(command, variables):
    """Run in a pseudo-terminal and return what it shows."""
    pty = pytest.importorskip("pty")
    leader, follower = pty.openpty()
    with subprocess.Popen(command, stdin=follower, stdout=follower, stderr=follower, env=variables) as process:
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
    variables = environment(TERM="xterm-256color", COLUMNS="140")
    variables.pop("NO_COLOR", None)
    shown = in_terminal([*COMMAND, "estimate", str(folder)], variables)
    assert "ambiguity" in shown
    assert "measuring" in shown
    coloured = "\x1b[3"
    assert coloured in shown
    assert coloured not in in_terminal([*COMMAND, "estimate", str(folder)], {**variables, "NO_COLOR": "1"})
