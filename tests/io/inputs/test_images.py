from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.errors import UsageError
from circlepose.io.inputs.images import InputImage, expand_inputs, natural_key


@pytest.fixture(autouse=True)
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in (
        "imgs/img10.png",
        "imgs/img2.png",
        "imgs/IMG1.JPG",
        "imgs/.hidden.png",
        "imgs/target.yaml",
        "imgs/sub/img1.png",
        "imgs/.cache/img1.png",
        "other/img2.png",
        "odd[1]/a[2].png",
        "odd[1]/b.png",
        "deep/below/a.png",
        "notes/a.txt",
        "notes/b.txt",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(*inputs: str, stdin: list[str] | None = None, recursive: bool = False) -> list[str]:
    images = list(expand_inputs(inputs, stdin, recursive))
    assert all(image.path.exists() for image in images)
    return [image.name for image in images]


def test_a_folder_in_natural_order_without_hidden_files() -> None:
    assert names("imgs") == names("imgs/") == names("./imgs") == ["IMG1.JPG", "img2.png", "img10.png"]
    assert [str(image.path) for image in expand_inputs(["imgs"])][1] == "imgs/img2.png"


def test_a_folder_and_those_below() -> None:
    assert names("imgs", recursive=True) == ["IMG1.JPG", "img2.png", "img10.png", "sub/img1.png"]


def test_several_inputs_keep_the_path_as_typed_so_that_no_two_names_are_equal() -> None:
    assert names("other", "imgs/") == ["other/img2.png", "imgs/IMG1.JPG", "imgs/img2.png", "imgs/img10.png"]
    assert names("./other", "imgs/img10.png") == ["./other/img2.png", "imgs/img10.png"]


def test_globs_that_the_shell_left() -> None:
    assert names("imgs/*.png") == ["imgs/img2.png", "imgs/img10.png"]
    assert names("imgs/*") == ["imgs/IMG1.JPG", "imgs/img2.png", "imgs/img10.png"]
    assert names("imgs/**/*.png") == ["imgs/img2.png", "imgs/img10.png", "imgs/sub/img1.png"]
    assert names("i*/img?.png") == ["imgs/img2.png"]
    assert names("imgs/img[0-9].png") == ["imgs/img2.png"]
    assert names(str(Path.cwd() / "imgs" / "*2.png")) == [str(Path.cwd() / "imgs" / "img2.png")]


def test_brackets_in_names_are_taken_as_they_are() -> None:
    assert names("odd[1]/a[2].png") == ["odd[1]/a[2].png"]
    assert names("odd[1]") == ["a[2].png", "b.png"]
    assert names("odd[1]/*.png") == ["odd[1]/a[2].png", "odd[1]/b.png"]


def test_each_image_once() -> None:
    assert names("imgs/img2.png", "imgs", "imgs/*.png") == ["imgs/img2.png", "imgs/IMG1.JPG", "imgs/img10.png"]
    assert names("imgs/img2.png", "./imgs//img2.png") == ["imgs/img2.png"]


def test_a_file_named_itself_is_never_refused_here() -> None:
    typed = ["imgs/none.png", "imgs/target.yaml", "imgs/.hidden.png", "x" * 5000, "a\0b"]
    assert [image.name for image in expand_inputs(typed)] == typed


def test_paths_on_standard_input() -> None:
    lines = ["imgs/img2.png\n", "\n", "no such [file]*.png\r\n", "imgs/ spaced .png"]
    images = list(expand_inputs(["-"], lines))
    assert images[0] == InputImage(Path("imgs/img2.png"), "imgs/img2.png")
    assert [image.name for image in images] == ["imgs/img2.png", "no such [file]*.png", "imgs/ spaced .png"]
    raw = list(expand_inputs(["-"], [b"caf\xe9.png\n"]))
    assert os.fsencode(raw[0].path) == b"caf\xe9.png"


def test_standard_input_among_others_keeps_its_place() -> None:
    assert names("other", "-", "imgs/img10.png", stdin=["imgs/img2.png"]) == [
        "other/img2.png",
        "imgs/img2.png",
        "imgs/img10.png",
    ]


def test_an_endless_producer_is_asked_for_one_path_at_a_time() -> None:
    asked = 0

    def produce() -> Iterator[str]:
        nonlocal asked
        for asked in itertools.count(1):
            yield f"{asked}.png\n"

    images = expand_inputs(["-"], produce())
    assert asked == 0
    assert [image.name for image in itertools.islice(images, 3)] == ["1.png", "2.png", "3.png"]
    assert asked == 3


@pytest.mark.parametrize(
    ("typed", "says"),
    [
        ("empty", "empty: is an empty folder"),
        ("notes", r"notes: holds no image, only 2 other files \(a.txt, b.txt\); images end in"),
        ("deep", "deep: holds no image itself, but folders in it do; add --recursive"),
        ("imgs/*.tif", r"imgs/\*.tif: matches no file"),
        ("notes/*", r"notes/\*: matches no image, only 2 other"),
        ("-", "-: no path came on standard input"),
    ],
)
def test_inputs_without_an_image(typed: str, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        list(expand_inputs([typed], []))


def test_inputs_are_checked_before_the_first_image() -> None:
    with pytest.raises(UsageError, match="empty"):
        expand_inputs(["imgs", "empty"])
    with pytest.raises(UsageError, match="no image was given"):
        expand_inputs([])
    with pytest.raises(UsageError, match="no standard input"):
        expand_inputs(["-"])


@given(st.lists(st.integers(0, 10**30), unique=True, min_size=1), st.text("ab-/", max_size=3))
def test_natural_order_is_that_of_the_numbers(numbers: list[int], stem: str) -> None:
    ordered = sorted((f"{stem}{number}.png" for number in numbers), key=natural_key)
    assert ordered == [f"{stem}{number}.png" for number in sorted(numbers)]


@given(st.lists(st.text(max_size=6)), st.randoms())
def test_natural_order_never_depends_on_the_listing(texts: list[str], random: Random) -> None:
    shuffled = random.sample(texts, len(texts))
    assert sorted(texts, key=natural_key) == sorted(shuffled, key=natural_key)
