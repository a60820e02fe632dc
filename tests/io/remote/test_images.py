"""Images at URLs: in memory, behind a web server and, where moto is installed, in a bucket."""

from __future__ import annotations

import csv
import functools
import http.server
import io
import itertools
import socket
import sys
import threading
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.support.services import s3_server
from circlepose.batch.measure import MeasureOptions, WorkItem, measure_file
from circlepose.errors import ImageError, UsageError
from circlepose.io.calibration.reader import read_camera
from circlepose.io.images.reader import read_image
from circlepose.io.inputs import images as inputs
from circlepose.io.inputs.images import InputImage, are_streamed, expand_inputs
from circlepose.io.remote import listing
from circlepose.io.remote.images import RemoteFile, is_url, place_of
from circlepose.io.tables.columns import write_csv
from circlepose.targets.target import Target
from circlepose_cli.app import main
from tests.support.discs import disc_folder

fsspec = pytest.importorskip("fsspec")

NAMES = (
    "img10.png",
    "img2.png",
    "notes.txt",
    ".hidden.png",
    "sub/a.png",
    "sub/deep/b.jpg",
    ".cache/c.png",
    "odd[1].png",
)


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    """A folder in memory."""
    files = fsspec.filesystem("memory")
    base = f"memory://{uuid.uuid4().hex}"
    for name in NAMES:
        files.pipe(f"{base}/{name}", name.encode())
    yield base
    files.rm(base, recursive=True)


@pytest.fixture(scope="module")
def discs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return disc_folder(tmp_path_factory.mktemp("discs"))


def names(*inputs: str, recursive: bool = False) -> list[str]:
    return [image.name for image in expand_inputs(inputs, None, recursive)]


def test_a_prefix_is_as_a_folder(bucket: str) -> None:
    assert names(f"{bucket}/") == ["img10.png", "img2.png", "odd[1].png"]
    below = ["img10.png", "img2.png", "odd[1].png", "sub/a.png", "sub/deep/b.jpg"]
    assert sorted(names(f"{bucket}/", recursive=True)) == below
    assert names(f"{bucket}/sub/", f"{bucket}/img2.png") == [f"{bucket}/sub/a.png", f"{bucket}/img2.png"]
    assert names(f"{bucket}/none.png") == [f"{bucket}/none.png"]


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("img*.png", ["img10.png", "img2.png"]),
        ("img?.png", ["img2.png"]),
        ("*/a.png", ["sub/a.png"]),
        ("s*/*.png", ["sub/a.png"]),
        ("**/*.png", ["img10.png", "img2.png", "odd[1].png", "sub/a.png"]),
        ("**", ["img10.png", "img2.png", "odd[1].png", "sub/a.png", "sub/deep/b.jpg"]),
        ("sub/**/b.jpg", ["sub/deep/b.jpg"]),
        (".h*", [".hidden.png"]),
        ("odd[1].png", ["odd[1].png"]),
        ("img[0-9].png", ["img2.png"]),
    ],
)
def test_globs(bucket: str, pattern: str, expected: list[str]) -> None:
    assert sorted(names(f"{bucket}/{pattern}")) == [f"{bucket}/{name}" for name in expected]


def test_inputs_without_an_image(bucket: str) -> None:
    for typed, says in (
        (f"{bucket}/nothing/", "holds no image"),
        (f"{bucket}/*.tif", "matches no image"),
        (f"{bucket}/none/*.png", "matches no image"),
        (f"{bucket}/sub/deep/", None),
    ):
        if says is None:
            assert names(typed) == ["b.jpg"]
            continue
        with pytest.raises(UsageError, match=says):
            expand_inputs([typed])
    fsspec.filesystem("memory").pipe(f"{bucket}/only/below/a.png", b"x")
    with pytest.raises(UsageError, match="prefixes in it do; add --recursive"):
        expand_inputs([f"{bucket}/only/"])


def test_urls_on_standard_input_are_taken_as_they_come(bucket: str) -> None:
    lines = (f"{bucket}/img{number}.png\n" for number in itertools.count())
    first, second = itertools.islice(expand_inputs(["-"], lines), 2)
    assert (first.name, second.name) == (f"{bucket}/img0.png", f"{bucket}/img1.png")
    assert first.path == RemoteFile(f"{bucket}/img0.png")


def test_what_is_streamed() -> None:
    assert are_streamed(["-"])
    assert are_streamed(["a.png", "s3://b/"])
    assert are_streamed(["s3://b/*.png"])
    assert not are_streamed(["a/", "*.png", "s3://b/a.png", "https://h/a.png?x=*"])


def test_listings_are_asked_for_page_by_page(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    class Pages:
        def call_s3(self, method: str, **options: str) -> dict[str, object]:
            asked.append(f"{options['Bucket']} {options['Prefix']} {options.get('ContinuationToken', '-')}")
            start = 1000 * (len(asked) - 1)
            keys = [{"Key": f"p/img{start + n:09d}.png", "Size": 5, "ETag": f"{n}"} for n in range(1000)]
            return {"Contents": keys, "IsTruncated": True, "NextContinuationToken": f"t{len(asked)}"}

    monkeypatch.setattr(listing, "opened", lambda url: (Pages(), url.removeprefix("s3://")))
    monkeypatch.setattr(inputs, "require", lambda _: None)
    images = expand_inputs(["s3://bucket/p/img*.png"])
    assert len(asked) == 1
    listed = list(itertools.islice(images, 2500))
    assert asked == ["bucket p/img -", "bucket p/img t1", "bucket p/img t2"]
    assert listed[2001].name == "s3://bucket/p/img000002001.png"
    assert listed[0].path.stat().st_size == 5


def test_file_urls_are_paths(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    (image,) = expand_inputs([f"file://{tmp_path}/a.png"])
    assert image == InputImage(tmp_path / "a.png", str(tmp_path / "a.png"))
    assert names(f"file://{tmp_path}/") == [f"{tmp_path}/a.png"]


def test_what_is_a_url() -> None:
    assert is_url("s3://b/a")
    assert is_url("https://h/a.png")
    assert not any(map(is_url, ("a.png", "C:\\a.png", "c:/a", "a://"[1:], "dir/s3://b", "s3:/b")))


def test_credentials_are_nowhere_shown() -> None:
    url = "https://user:secret@host/a/b.png?X-Amz-Signature=secret"
    (image,) = expand_inputs([url])
    assert image.name == str(image.path) == "https://***@host/a/b.png?***"
    place = place_of(url)
    assert isinstance(place, RemoteFile)
    assert place.url == url
    assert str(place.parent) == "https://***@host/a/"
    for text in (str(place), repr(place), repr(image), f"{place}", place.name, repr(place.parent)):
        assert "secret" not in text
    with pytest.raises(OSError, match="query") as caught:
        place.stat()
    assert "secret" not in str(caught.value)


def test_reading(bucket: str, discs: Path) -> None:
    files = fsspec.filesystem("memory")
    content = (discs / "disc0.png").read_bytes()
    files.pipe(f"{bucket}/read/a.png", content)
    assert read_image(RemoteFile(f"{bucket}/read/a.png")).shape == read_image(discs / "disc0.png").shape
    files.pipe(f"{bucket}/read/cut.png", content[:-50])
    for name, status in (("cut.png", "truncated_image"), ("none.png", "unreadable")):
        with pytest.raises(ImageError) as caught:
            read_image(RemoteFile(f"{bucket}/read/{name}"))
        assert caught.value.status == status
        assert str(caught.value).startswith(f"{bucket}/read/{name}: ")


def test_states_tell_whether_an_object_changed(bucket: str) -> None:
    files = fsspec.filesystem("memory")
    file = RemoteFile(f"{bucket}/changing.png")
    files.pipe(file.url, b"one")
    before = file.stat()
    assert file.stat() == before
    time.sleep(0.001)
    files.pipe(file.url, b"two")
    assert file.stat() != before
    with pytest.raises(OSError, match="none"):
        RemoteFile(f"{bucket}/none.png").stat()


def test_without_fsspec_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fsspec", None)
    for typed in ("s3://u:secret@b/a.png", "s3://b/p/", "s3://b/*.png"):
        with pytest.raises(UsageError, match=r"pip install 'circlepose\[cluster\]'") as caught:
            expand_inputs([typed])
        assert "secret" not in str(caught.value)
    # In a list, it costs the rows of those images only.
    (image,) = expand_inputs(["-"], ["s3://u:secret@b/a.png\n"])
    with pytest.raises(ImageError, match=r"pip install 'circlepose\[cluster\]'") as refused:
        read_image(image.path)
    assert "secret" not in str(refused.value)
    monkeypatch.undo()
    with pytest.raises(UsageError, match="no kind of URL"):
        expand_inputs(["nosuch://b/a.png"])


def estimate(capfd: pytest.CaptureFixture[str], discs: Path, *args: str) -> tuple[int, list[dict[str, str]], str]:
    given = ["--calib", str(discs / "camera.yaml"), "--radius-mm", "20", "--format", "csv"]
    code = main(["estimate", *args, *given])
    captured = capfd.readouterr()
    return code, list(csv.DictReader(io.StringIO(captured.out))), captured.err


def local_rows(capfd: pytest.CaptureFixture[str], discs: Path) -> list[dict[str, str]]:
    code, rows, _ = estimate(capfd, discs, str(discs))
    assert code == 0
    return rows


def test_a_prefix_is_measured_as_a_folder_is(bucket: str, discs: Path, capfd: pytest.CaptureFixture[str]) -> None:
    files = fsspec.filesystem("memory")
    for path in discs.glob("*.png"):
        files.pipe(f"{bucket}/discs/{path.name}", path.read_bytes())
    # In this process: the memory is no other's.
    camera, target = read_camera(discs / "camera.yaml"), Target.circle(20.0)
    images = expand_inputs([f"{bucket}/discs/"])
    results = [measure_file(WorkItem(each.path, each.name, camera, target), MeasureOptions()) for each in images]
    handle = io.StringIO()
    write_csv(results, handle)
    assert list(csv.DictReader(io.StringIO(handle.getvalue()))) == local_rows(capfd, discs)


def test_images_at_urls_need_a_calibration_of_their_own(bucket: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", f"{bucket}/img2.png"]) == 2
    assert f"{bucket}/: no calibration for the images there; give --calib FILE." in capfd.readouterr().err


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def server(discs: Path) -> Iterator[str]:
    pytest.importorskip("aiohttp")
    handler = functools.partial(Quiet, directory=str(discs))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{running.server_port}"
        running.shutdown()


def test_images_behind_a_web_server(server: str, discs: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert names(f"{server}/") == ["disc0.png", "disc1.png"]
    assert names(f"{server}/disc*.png") == [f"{server}/disc0.png", f"{server}/disc1.png"]
    urls = [f"{server}/disc0.png?token=secret", f"{server}/none.png"]
    code, rows, err = estimate(capfd, discs, *urls, "--jobs", "1")
    assert code == 3
    assert [(row["image"], row["status"]) for row in rows] == [
        (f"{server}/disc0.png?***", "ok"),
        (f"{server}/disc0.png?***", "ok"),
        (f"{server}/none.png", "unreadable"),
    ]
    assert "secret" not in err
    assert "none.png: there is no such object" in err


def test_a_server_that_is_not_there(capfd: pytest.CaptureFixture[str], discs: Path) -> None:
    pytest.importorskip("aiohttp")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"http://user:secret@127.0.0.1:{port}"
    code, rows, err = estimate(capfd, discs, f"{url}/a.png", "--jobs", "1")
    assert (code, rows[0]["status"]) == (3, "unreadable")
    assert main(["estimate", f"{url}/"]) == 2
    err += capfd.readouterr().err
    assert "secret" not in err
    assert "Traceback" not in err


@pytest.fixture(scope="module")
def s3(discs: Path) -> Iterator[str]:
    """A bucket on a server of this machine, with the discs in it."""
    pytest.importorskip("moto")
    pytest.importorskip("flask")
    pytest.importorskip("s3fs")
    with s3_server() as settings, pytest.MonkeyPatch.context() as patch:
        for name, value in settings.items():
            patch.setenv(name, value)
        files = fsspec.filesystem("s3", skip_instance_cache=True)
        files.mkdir("bucket")
        for path in discs.glob("*.png"):
            files.pipe(f"bucket/imgs/{path.name}", path.read_bytes())
            files.pipe(f"bucket/imgs/sub/{path.name}", path.read_bytes())
        files.pipe("bucket/imgs/empty.png", b"")
        yield "s3://bucket"


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_bucket(s3: str, discs: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert names(f"{s3}/imgs/") == ["disc0.png", "disc1.png", "empty.png"]
    monkeypatch.setattr(listing, "_PAGE", 2)
    every = ["disc0.png", "disc1.png", "empty.png", "sub/disc0.png", "sub/disc1.png"]
    assert names(f"{s3}/imgs/", recursive=True) == every
    assert names(f"{s3}/imgs/**/disc1.png") == [f"{s3}/imgs/disc1.png", f"{s3}/imgs/sub/disc1.png"]
    assert names(f"{s3}/imgs/disc*") == [f"{s3}/imgs/disc0.png", f"{s3}/imgs/disc1.png"]
    (image,) = expand_inputs([f"{s3}/imgs/disc0.png"])
    (listed,) = expand_inputs([f"{s3}/imgs/disc0*"])
    assert image.path.stat() == listed.path.stat()
    code, rows, err = estimate(capfd, discs, f"{s3}/imgs/", "--jobs", "1")
    assert (code, rows[:-1]) == (3, local_rows(capfd, discs))
    assert (rows[-1]["image"], rows[-1]["status"]) == ("empty.png", "not_an_image")
    assert "very-secret" not in err
    # Two colons in a name are no chain of URLs.
    fsspec.filesystem("s3").pipe_file("bucket/odd/a::b.png", b"content")
    assert names(f"{s3}/odd/") == ["a::b.png"]
    assert RemoteFile(f"{s3}/odd/a::b.png").read_bytes() == b"content"
    with pytest.raises(UsageError, match="s3://none/"):
        expand_inputs(["s3://none/"])
    with pytest.raises(ImageError, match="there is no such object"):
        read_image(RemoteFile(f"{s3}/imgs/none.png"))
