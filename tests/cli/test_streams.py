"""Standard streams that are closed, full or left by their reader, as a shell makes them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from circlepose_cli.console.streams import standard_streams
from tests.support.discs import disc_folder, found_notes
from tests.support.processes import SETTLE, run, shell

STATUS = '; echo "${PIPESTATUS[*]}"'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return disc_folder(tmp_path_factory.mktemp("streams") / "imgs")


@pytest.mark.parametrize(
    ("line", "first"),
    [
        ("$circlepose estimate -q $1 | head -n1", "image,instance,circle,"),
        ("$circlepose estimate -q --format json $1 | head -n1", '{"schema"'),
        ("$circlepose estimate -q --format table $1 | true", ""),
        ("$circlepose --help | true", ""),
        ("$circlepose estimate --help | head -n1", ""),
        ("$circlepose camera $1/camera.yaml | true", ""),
        ("$circlepose inspect $1/disc0.png | true", ""),
        ("$circlepose explain -q $1/disc0.png | true", ""),
        ("$circlepose statuses | head -n1", "Status:"),
    ],
)
def test_a_reader_that_has_enough_is_no_failure(folder, line, first):
    done = shell(line + STATUS, folder)
    assert done.stdout.startswith(first)
    assert done.stdout.splitlines()[-1] == "0 0"
    assert "Error" not in done.stderr


@pytest.mark.parametrize("command", ["estimate -q $1", "--help", "--version", "camera $1/camera.yaml", "statuses"])
def test_a_full_disk_is_one_sentence(folder, command):
    if not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full here")
    done = shell(f"$circlepose {command} > /dev/full", folder)
    assert done.returncode == 2
    assert done.stderr == "circlepose: standard output: cannot be written (No space left on device).\n"


def test_closed_standard_output_is_no_error_where_a_file_is_given(folder, tmp_path):
    done = shell("$circlepose estimate $1 -o $2 >&-", folder, tmp_path / "t.csv")
    assert (done.returncode, done.stderr.removeprefix(found_notes(folder))) == (
        0,
        f"{tmp_path}/t.csv: written\n2 measured, 0 failed, 2 ambiguous: {SETTLE}\n",
    )
    assert (tmp_path / "t.csv").read_text().count("\ndisc") == 4


def test_closed_standard_output_is_one_sentence_without_a_file(folder):
    done = shell("$circlepose estimate $1 >&-", folder)
    assert done.returncode == 2
    assert done.stderr.removeprefix(found_notes(folder)) == (
        "circlepose: standard output: is closed; open it, or give -o FILE where the command has it.\n"
    )


@pytest.mark.parametrize("jobs", [1, 2])
def test_messages_never_land_among_the_data(folder, jobs):
    plain = run("estimate", folder, folder / "gone.png", "--jobs", jobs)
    closed = shell(f"$circlepose estimate $1 $1/gone.png --jobs {jobs} 2>&-", folder)
    assert plain.stderr != ""
    assert (closed.returncode, closed.stdout, closed.stderr) == (3, plain.stdout, "")


def test_an_error_with_closed_standard_error_leaves_no_data(tmp_path):
    done = shell("$circlepose camera $1 2>&-", tmp_path / "gone.yaml")
    assert (done.returncode, done.stdout) == (2, "")


def test_messages_that_cannot_be_written_do_not_end_a_run(folder):
    if not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full here")
    done = shell("$circlepose estimate $1 2> /dev/full", folder)
    assert done.returncode == 0
    assert done.stdout.count("\ndisc") == 4


def test_all_streams_closed_is_a_run_like_any_other(folder, tmp_path):
    done = shell("$circlepose estimate $1 -o $2 <&- >&- 2>&-", folder, tmp_path / "t.csv")
    assert done.returncode == 0
    assert (tmp_path / "t.csv").read_text().count("\ndisc") == 4


def test_a_working_directory_that_was_deleted_is_named(folder, tmp_path):
    done = shell("mkdir $2 && cd $2 && rmdir $2 && $circlepose estimate $1 -o t.csv", folder, tmp_path / "gone")
    assert (done.returncode, done.stdout) == (2, "")
    assert (
        done.stderr.removeprefix(found_notes(folder))
        == "circlepose: the working directory no longer exists; change to another.\n"
    )


def test_too_many_open_files_are_named(folder):
    done = shell("ulimit -n 10; $circlepose estimate $1 --jobs 2", folder)
    assert done.returncode == 2
    assert done.stderr.removeprefix(found_notes(folder)).startswith(
        "circlepose: too many files are open; raise the limit (ulimit -n)"
    )
    assert "Traceback" not in done.stderr


def test_streams_are_as_before_afterwards(capsys):
    before = sys.stdout, sys.stderr
    with standard_streams():
        print("caf\u00e9")
        print("message", file=sys.stderr)
    assert (sys.stdout, sys.stderr) == before
    print("after")
    assert capsys.readouterr().err == "message\n"
