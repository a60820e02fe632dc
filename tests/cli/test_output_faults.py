"""Each call of the system that writes a table, a picture or a journal fails once: the former file stays whole."""

from __future__ import annotations

import errno
import io
import os
from contextlib import suppress

import pytest

from circlepose.batch import journal as journal_module
from circlepose.batch.journal import Journal
from circlepose.errors import CircleposeError
from circlepose.io import atomic
from circlepose.io.atomic import atomic_writer
from circlepose_cli.app import main
from tests.support.discs import disc_folder

CALLS = ("open", "fsync", "replace", "unlink", "fstat", "scandir", "write")


class Faults:
    """Stands for the module `os`: counts the calls by name and has one of them fail."""

    def __init__(self, failing: int, number: int = errno.EIO) -> None:
        self.calls: list[str] = []
        self._failing = failing
        self._number = number

    def __getattr__(self, name):
        real = getattr(os, name)
        return (lambda *args, **more: self.call(name, real, *args, **more)) if name in CALLS else real

    def call(self, name, real, *args, **more):
        self.calls.append(name)
        if len(self.calls) - 1 == self._failing:
            raise OSError(self._number, os.strerror(self._number), *map(str, args[:1]) if name != "write" else ())
        return real(*args, **more)

    def file(self, descriptor):
        faults = self

        class File(io.FileIO):
            def write(self, data):
                return faults.call("write", super().write, data)

        return File(descriptor, "wb")


@pytest.fixture
def faulty(monkeypatch):
    """Install faults: `faulty(n)` has the n-th call fail."""

    def install(failing, number=errno.EIO):
        faults = Faults(failing, number)
        for module in (atomic, journal_module):
            monkeypatch.setattr(module, "os", faults)
        monkeypatch.setattr(atomic, "raw_file", faults.file)
        return faults

    return install


def how_many(faulty, write):
    faults = faulty(-1)
    write()
    assert {"open", "write", "fsync", "replace"} <= set(faults.calls)
    return len(faults.calls)


@pytest.mark.parametrize("number", [errno.EIO, errno.ENOSPC, errno.EDQUOT])
def test_a_file_is_the_former_or_the_new_one_whichever_call_fails(tmp_path, faulty, number):
    path = tmp_path / "t.csv"
    former, new = b"image,instance,circle,method,solution,\nold", b"image,instance,circle,method,solution,\nnew"

    def write():
        with atomic_writer(path, binary=True) as handle:
            handle.write(new)

    path.write_bytes(former)
    calls = how_many(faulty, write)
    assert path.read_bytes() == new
    for failing in range(calls):
        path.write_bytes(former)
        faults = faulty(failing, number)
        with suppress(CircleposeError, OSError):
            write()
        renamed = "replace" in faults.calls[:failing]
        assert path.read_bytes() == (new if renamed else former), faults.calls
        left = [each for each in tmp_path.iterdir() if each != path]
        # What cannot be removed stays, under a name that no file of a user has.
        assert left == [] or faults.calls[failing] == "unlink"
        for each in left:
            each.unlink()


@pytest.mark.parametrize("picture", [False, True])
def test_a_run_ends_with_one_sentence_and_the_former_table(tmp_path, capsys, faulty, picture):
    folder = disc_folder(tmp_path / "imgs")
    out = tmp_path / "t.csv"
    command = ["estimate", "-q", str(folder), "-o", str(out)]
    if picture:
        command = ["explain", "-q", str(folder / "disc0.png"), "--picture", str(tmp_path / "t.png")]
        out = tmp_path / "t.png"
    calls = how_many(faulty, lambda: main(command))
    former = out.read_bytes()
    for failing in range(calls):
        faults = faulty(failing)
        capsys.readouterr()
        code = main(command)
        err = capsys.readouterr().err
        assert code in (0, 2), (faults.calls[failing], err)
        assert "Traceback" not in err
        assert "bug" not in err
        assert err.count("\n") <= 1
        assert out.read_bytes() == former
        faulty(-1)
        # The next run is not disturbed by what the failed one left.
        assert main(command) == 0
        assert out.read_bytes() == former


def test_what_a_journal_holds_is_kept_whichever_call_fails(tmp_path, faulty):
    path = tmp_path / "t.csv.journal"

    def opened():
        return Journal(path, {"a": "1"}, resume=True, output="t.csv")

    with opened() as journal:
        journal.add("first", {"value": 1})
    before = path.read_bytes()
    for failing in range(12):
        path.write_bytes(before)
        faults = faulty(failing)
        with suppress(CircleposeError, OSError), opened() as journal:
            journal.add("second", {"value": 2})
        faulty(-1)
        with opened() as journal:
            assert journal.find("first") == {"value": 1}, faults.calls
