"""Tables that are written to a URL: whole or not at all, and gone on with after a run that was not completed."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from circlepose.batch import measure as local
from circlepose.io.remote import output
from circlepose.io.remote.images import RemoteFile
from circlepose.results import ImageResult, Status
from circlepose_cli.app import main
from tests.support.discs import disc_folder, found_notes

fsspec = pytest.importorskip("fsspec")

BEFORE = b"image,instance,circle,method,solution,\n"


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "circlepose"


@pytest.fixture
def base() -> Iterator[str]:
    files = fsspec.filesystem("memory")
    name = f"memory://{uuid.uuid4().hex}"
    files.makedirs(name)
    yield name
    files.rm(name, recursive=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return disc_folder(tmp_path_factory.mktemp("output") / "imgs", images=3)


def there(base: str) -> dict[str, bytes]:
    files = fsspec.filesystem("memory")
    return {path.rsplit("/", 1)[-1]: files.cat_file(path) for path in files.find(base)}


@pytest.mark.parametrize("name", ["poses.csv", "poses.jsonl", "poses.json", "poses.tsv.gz"])
def test_the_bytes_are_those_of_a_file(folder: Path, base: str, state: Path, tmp_path: Path, name: str) -> None:
    assert main(["estimate", str(folder), "-o", str(tmp_path / name)]) == 0
    assert main(["estimate", str(folder), "-o", f"{base}/{name}"]) == 0
    assert there(base) == {name: (tmp_path / name).read_bytes()}
    assert not list(state.iterdir())


def test_a_file_url_is_a_path(folder: Path, tmp_path: Path) -> None:
    assert main(["estimate", str(folder), "-o", f"file://{tmp_path}/poses.csv"]) == 0
    assert (tmp_path / "poses.csv").exists()


def test_what_is_left_is_resumed(folder: Path, base: str, state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert main(["estimate", str(folder), "-o", f"{base}/whole.csv"]) == 0
    measure = local.measure_file
    measured = []

    def broken(item: local.WorkItem, options: local.MeasureOptions) -> ImageResult:
        if item.name == "disc1.png":
            return ImageResult(item.name, Status.WORKER_DIED, "oh")
        return measure(item, options)

    def counted(item: local.WorkItem, options: local.MeasureOptions) -> ImageResult:
        measured.append(item.name)
        return measure(item, options)

    monkeypatch.setattr(local, "measure_file", broken)
    assert main(["estimate", str(folder), "-o", f"{base}/out.csv"]) == 3
    assert b"worker_died" in there(base)["out.csv"]
    (journal,) = state.iterdir()
    assert journal.name.endswith("out.csv.journal")
    # The journal of one URL is not that of another with the same name.
    assert main(["estimate", str(folder), "-o", f"{base}/other/out.csv"]) == 3
    assert len(list(state.iterdir())) == 2
    monkeypatch.setattr(local, "measure_file", counted)
    assert main(["estimate", str(folder), "-o", f"{base}/out.csv", "--resume"]) == 0
    assert measured == ["disc1.png"]
    assert there(base)["out.csv"] == there(base)["whole.csv"]


def test_an_upload_that_fails_leaves_what_was_there_and_is_gone_on_with(
    folder: Path, base: str, state: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    files = fsspec.filesystem("memory")
    files.pipe_file(f"{base}/out.csv", BEFORE)

    def refused(*_: object, **__: object) -> None:
        raise ConnectionError("user:secret@host went away s3://user:secret@host/x")

    with monkeypatch.context() as patch:
        patch.setattr(type(files), "put_file", refused)
        assert main(["estimate", str(folder), "-o", f"{base}/out.csv"]) == 2
    err = capfd.readouterr().err
    assert f"circlepose: {base}/out.csv: cannot be written (ConnectionError: " in err
    assert "; what is finished is kept, go on with --resume.\n" in err
    assert "s3://user:secret" not in err
    assert there(base) == {"out.csv": BEFORE}
    assert [path.suffix for path in state.iterdir()] == [".journal"]
    monkeypatch.setattr(local, "measure_file", None)
    assert main(["estimate", str(folder), "-o", f"{base}/out.csv", "--resume"]) == 0
    assert there(base)["out.csv"].startswith(b"image,")
    assert not list(state.iterdir())


def test_what_cannot_be_written_is_told_before_the_first_image(
    folder: Path, base: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(local, "measure_file", None)
    files = fsspec.filesystem("memory")

    def refused(*_: object, **__: object) -> None:
        raise PermissionError("no")

    monkeypatch.setattr(type(files), "pipe_file", refused)
    for typed, says in (
        (f"{base}/out.csv", "cannot be written (permission denied)."),
        ("https://user:secret@host/out.csv", "nothing can be written there; give a file"),
        (f"{base}/out/", "is a folder"),
        ("nosuch://bucket/out.csv", "nosuch:// is no kind of URL"),
    ):
        assert main(["estimate", str(folder), "-o", typed]) == 2
        out, err = capfd.readouterr()
        assert (out, err.removeprefix(found_notes(folder)).count("\n")) == ("", 1)
        assert says in err
        assert "secret" not in err


def test_a_folder_for_the_journal_that_cannot_be_made(
    folder: Path, base: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    assert main(["estimate", str(folder), "-o", f"{base}/out.csv"]) == 2
    assert "name another in XDG_STATE_HOME." in capfd.readouterr().err
    assert not there(base)


def test_where_names_come_before_contents_a_part_is_renamed(base: str, tmp_path: Path) -> None:
    """As with folders behind SSH: who reads there meanwhile sees the old file or the new one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(output, "_WHOLE", set())
        place = RemoteFile(f"{base}/out.csv")
        with output.uploading_writer(place) as handle:
            handle.write(b"text")
            assert not there(base)
    assert there(base) == {"out.csv": b"text"}
