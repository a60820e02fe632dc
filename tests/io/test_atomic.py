from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import TextIO

import pytest

from circlepose.errors import OutputError
from circlepose.io.atomic import atomic_writer


def test_text_and_binary_are_written_as_given(tmp_path: Path) -> None:
    with atomic_writer(tmp_path / "t.csv") as text:
        text.write("a\r\nb\né\udcff")
    assert (tmp_path / "t.csv").read_bytes() == b"a\r\nb\n\xc3\xa9\xff"
    with atomic_writer(tmp_path / "b.bin", binary=True) as binary:
        binary.write(b"\0\1")
    assert (tmp_path / "b.bin").read_bytes() == b"\0\1"


def _write_and_break_off(handle: TextIO, path: Path) -> None:
    handle.write("new")
    handle.flush()
    assert path.read_text() == "old"
    raise KeyboardInterrupt


def test_nothing_changes_before_the_end_nor_after_a_failure(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), atomic_writer(path, overwrite=True) as handle:
        _write_and_break_off(handle, path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_the_mode_is_that_of_any_new_file(tmp_path: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        with atomic_writer(tmp_path / "t.csv") as handle:
            handle.write("x")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "t.csv").stat().st_mode) == 0o666 & ~mask


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real.csv").write_text("")
    (tmp_path / "link.csv").symlink_to(tmp_path / "real.csv")
    with atomic_writer(tmp_path / "link.csv") as handle:
        handle.write("new")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "new"


def test_a_device_is_not_replaced() -> None:
    with atomic_writer("/dev/null") as handle:
        handle.write("gone")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match=r"t\.csv: the folder .*none does not exist"),
        atomic_writer(tmp_path / "none" / "t.csv"),
    ):
        pass
    with pytest.raises(OutputError, match="is a folder"), atomic_writer(tmp_path):
        pass
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="cannot be written"), atomic_writer(tmp_path / "file" / "t.csv"):
        pass


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="Permission denied"), atomic_writer(tmp_path / "t.csv"):
        pass


def test_a_full_disk_is_told_and_other_errors_pass(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"t\.csv: cannot be written"), atomic_writer(tmp_path / "t.csv"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with pytest.raises(BrokenPipeError), atomic_writer(tmp_path / "t.csv"):
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))
    assert list(tmp_path.iterdir()) == []
