"""Folders, links and names that are not as one hopes: each image has its row, or one message tells."""

from __future__ import annotations

import csv
import glob
import io
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.errors import ImageError, UsageError
from circlepose.io.images.reader import read_image
from circlepose.io.inputs import images as inputs
from circlepose.io.inputs.globs import matches
from circlepose.io.inputs.images import expand_inputs
from circlepose.io.text.escaping import unguarded, unquoted
from circlepose_cli.app import main

POSIX = pytest.mark.skipif(os.name != "posix", reason="needs POSIX files")


def names(*typed: str, recursive: bool = False) -> list[str]:
    return [image.name for image in expand_inputs(typed, None, recursive)]


@POSIX
def test_links_that_lead_round_in_a_circle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("a", "a/b", "a/b/c"):
        Path(folder).mkdir()
        Path(folder, "1.png").touch()
        # Followed, these three would give 3 ** 40 paths.
        for number in range(3):
            Path(folder, f"loop{number}").symlink_to(tmp_path / "a", target_is_directory=True)
    every = ["a/1.png", "a/b/1.png", "a/b/c/1.png"]
    assert names("a/**/*.png") == names("**/1.png") == every
    assert names("a", recursive=True) == [name.removeprefix("a/") for name in every]
    assert names("a/loop0/*.png") == ["a/loop0/1.png"]
    assert names("a/*/1.png") == ["a/b/1.png", "a/loop0/1.png", "a/loop1/1.png", "a/loop2/1.png"]


PART = st.sampled_from(["*", "a", "b*", "?", "[ab]", "[!a]*", ".*", "*.png", "c.png", ".h"])
TREE = [
    "a",
    "b",
    "ab",
    ".h",
    "c.png",
    "a/a",
    "a/b",
    "a/.h",
    "a/c.png",
    "a/a/b",
    "a/a/c.png",
    "b/ab",
    "b/c.png",
    ".h/c.png",
]


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    base = tmp_path_factory.mktemp("tree")
    for name in TREE:
        (base / name).mkdir(parents=True) if not name.endswith(".png") else (base / name).touch()
    return base


@given(st.lists(PART | st.just("**"), max_size=3), PART)
def test_globs_match_what_pythons_do(tree: Path, folders: list[str], last: str) -> None:
    pattern = "/".join([*folders, last])
    assert relative(tree, [*folders, last]) == set(glob.glob(pattern, root_dir=tree, recursive=True))  # noqa: PTH207


def relative(tree: Path, parts: list[str]) -> set[str]:
    return {os.path.relpath(each, tree) for each in matches(str(tree), parts)}


def test_a_folder_of_a_hundred_thousand_images(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    count = 100_000
    found = sorted(f"{tmp_path}/img{number}.png" for number in range(count))
    monkeypatch.setattr(inputs, "_walk", lambda *_: iter([(found, [])]))
    assert names(str(tmp_path)) == [f"img{number}.png" for number in range(count)]


def test_a_hint_does_not_look_through_everything(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    walk, looked = inputs._walk, []

    def counted(folder: str, refused: Any) -> Iterator[tuple[list[str], list[str]]]:
        for each in walk(folder, refused) if folder == str(tmp_path) else endless():
            looked.append(each)
            yield each

    def endless() -> Iterator[tuple[list[str], list[str]]]:
        while True:
            yield ["a.txt"], []

    monkeypatch.setattr(inputs, "_walk", counted)
    with pytest.raises(UsageError, match="is an empty folder"):
        names(str(tmp_path))
    assert 1 < len(looked) < 100


@contextmanager
def nested(names_: Sequence[str]) -> Iterator[None]:
    """Folders in one another in the working one, an image in the last; nothing is left of them."""
    # One by one, as their whole path may be longer than the system takes.
    place = Path.cwd()
    for name in names_:
        os.mkdir(name)  # noqa: PTH102
        os.chdir(name)
    Path("a.png").touch()
    os.chdir(place)
    try:
        yield
    finally:
        for name in names_:
            os.chdir(name)
        Path("a.png").unlink()
        for name in reversed(names_):
            os.chdir("..")
            os.rmdir(name)  # noqa: PTH106


@POSIX
@pytest.mark.parametrize("typed", ["deep", "deep/**/*.png", "deep/**/**/a.png"])
def test_folders_deep_in_one_another(tmp_path: Path, typed: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with nested(["deep", *["d"] * 1200]):
        found = [image.name for image in expand_inputs([typed], recursive=True)]
    assert [name.count("d/") for name in found] == [1200]


@POSIX
@pytest.mark.parametrize("typed", [".", "./**/*.png"])
def test_a_path_longer_than_the_system_takes_is_one_sentence(
    tmp_path: Path, typed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with nested(["d" * 200] * 30), pytest.raises(UsageError, match=r"cannot be read \(File name too long\)"):
        list(expand_inputs([typed], recursive=True))


def test_an_image_that_vanishes_after_it_was_listed(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    (image,) = expand_inputs([str(tmp_path)])
    Path(image.path).unlink()
    with pytest.raises(ImageError, match="there is no such file") as caught:
        read_image(image.path)
    assert caught.value.status == "unreadable"


def test_a_folder_that_vanishes_before_it_is_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inputs, "_is_folder", lambda _: True)
    with pytest.raises(UsageError, match=r"gone: the folder cannot be read \(No such file or directory\)"):
        names(str(tmp_path / "gone"))
    with pytest.raises(UsageError, match="the folder cannot be read"):
        list(matches(str(tmp_path / "gone"), ["*"]))


@given(st.lists(st.binary(max_size=30) | st.from_regex(rb"[a-z0-9]{1,4}x://[ -~]{0,9}", fullmatch=True), max_size=5))
def test_whatever_comes_on_standard_input_is_a_status(lines: list[bytes]) -> None:
    lines = [b"".join(line.splitlines()) for line in lines]
    expected = sum(bool(line) for line in lines)
    if not expected:
        return
    images = list(expand_inputs(["-"], [line + b"\n" for line in lines]))
    assert len(images) == expected
    for image in images:
        with pytest.raises(ImageError) as caught:
            read_image(image.path)
        assert caught.value.status == "unreadable"


def test_a_folder_named_like_an_image(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.png").mkdir()
    with pytest.raises(UsageError, match="is an empty folder"):
        names("x.png")
    Path("a.png").touch()
    assert names(".") == names("*.png") == ["a.png"]


HOSTILE = [
    b"=1+1.png",
    b"-rf.png",
    b"@a.png",
    b"a\nb.png",
    b"a\rb.png",
    b"\t.png",
    b"caf\xe9.png",
    b"\x1b]0;title\x07\x1b[2J.png",
    b"q'\"`$x.png",
    b"$'a'.png",
    b"a,b;c.png",
    "é 图 \u202egnp.png".encode(),
    b"spaced .png",
    b"%s%n{0}.png",
    b"<b>&amp;.png",
    b"[red]x.png",
    b"back\\slash.png",
]


@POSIX
@pytest.mark.parametrize("form", ["csv", "jsonl", "table"])
def test_a_folder_of_bad_files_under_bad_names(
    tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    monkeypatch.chdir(tmp_path)
    images = tmp_path / "imgs"
    images.mkdir()
    try:
        for name in HOSTILE:
            (images / os.fsdecode(name)).touch()
    except OSError:
        pytest.skip("the file system does not take these names")
    os.mkfifo(images / "pipe.png")
    (images / "circle.png").symlink_to("circle.png")
    (images / "dangling.png").symlink_to("none.png")
    (images / "folder.png").mkdir()
    (images / "device.png").symlink_to("/dev/zero")
    (images / "ok.png").write_bytes(cv2.imencode(".png", np.zeros((48, 64), np.uint8))[1].tobytes())
    (images / "camera.yaml").write_text("fx: 60\nfy: 60\ncx: 31.5\ncy: 23.5\nimage_size: [64, 48]\ndist_coeffs: []\n")
    command = ["estimate", "imgs", "--radius-mm", "10", "--format", form, "--jobs", "1", "--overlay", "out"]
    assert main(command) == 3
    captured = capfdbinary.readouterr()
    out, err = captured.out.decode("utf-8"), captured.err.decode("utf-8")
    assert all(line.isprintable() for line in err.splitlines())
    assert all(line.isprintable() for line in out.splitlines())
    # A line for each, the calibration that was found and the sum.
    assert len(err.splitlines()) == len(HOSTILE) + 7
    assert "Traceback" not in err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["ok.png"]
    assert {path.name for path in tmp_path.iterdir()} == {"imgs", "out"}
    if form != "table":
        rows = rows_of(out, form)
        expected = dict.fromkeys(map(os.fsdecode, HOSTILE), "not_an_image")
        expected |= dict.fromkeys(("pipe.png", "circle.png", "dangling.png", "device.png"), "unreadable")
        assert rows == expected | {"ok.png": "no_circle"}


def rows_of(text: str, form: str) -> dict[str, str]:
    """Return the status of each image, by its file's name."""
    if form == "csv":
        return {unquoted(unguarded(row["image"])): row["status"] for row in csv.DictReader(io.StringIO(text))}
    records = [json.loads(line) for line in text.splitlines()]
    return {unquoted(record["image"]): record["status"] for record in records}
