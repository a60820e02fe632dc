"""Pictures never leave their folder, and no two of them share a name."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circlepose.errors import UsageError
from circlepose.io.inputs.images import InputImage
from circlepose_cli.output.overlay_names import OverlayNames

NASTY = st.text("ab./\\_-:*\n\x1b\u202e\udce9éE\u0301 ", max_size=12) | st.text(max_size=300)


def image(name: str) -> InputImage:
    return InputImage(Path("/elsewhere/x.png"), name)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("overlays")


@settings(max_examples=60)
@given(st.lists(NASTY, max_size=8), st.booleans())
def test_names_are_distinct_and_stay_inside(folder: Path, names: list[str], known: bool) -> None:
    images = [image(name) for name in names]
    pictures = OverlayNames(folder, images if known else ())
    paths = [pictures.path_for(each) for each in images]
    assert len({path.name.casefold() for path in paths}) == len(paths)
    for path in paths:
        assert path.resolve().parent == folder.resolve()
        assert path.suffix == ".png"
        assert len(os.fsencode(path.name)) <= 255
        assert not any(mark in path.name for mark in "/\\\n\x1b\u202e:*")


def test_names_that_differ_late_stay_apart_when_they_are_cut(tmp_path: Path) -> None:
    pictures = OverlayNames(tmp_path, ())
    first, second = (pictures.path_for(image(f"{'é' * 200}{end}.png")) for end in "ab")
    assert first != second
    for path in (first, second):
        path.touch()


def test_names_that_are_one_file_on_some_systems_stay_apart(tmp_path: Path) -> None:
    pictures = OverlayNames(tmp_path, ())
    names = [pictures.path_for(image(name)).name for name in ("caf\u00e9.png", "cafe\u0301.png", "CAF\u00c9.png")]
    assert names == ["caf\u00e9.png", "cafe\u0301-2.png", "CAF\u00c9-3.png"]


@pytest.mark.skipif(os.name != "posix", reason="needs links")
def test_a_picture_is_not_written_through_a_link_that_lies_there(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.png").symlink_to(tmp_path / "precious")
    assert OverlayNames(tmp_path / "out", ()).path_for(image("a.png")).name == "a-2.png"


@pytest.mark.skipif(os.name != "posix", reason="needs links")
def test_links_that_lead_round_in_a_circle_are_no_bug(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    pictures = OverlayNames(tmp_path / "out", ())
    assert pictures.path_for(InputImage(tmp_path / "a" / "x.png", "a/x.png")).name == "x.png"


def test_the_folder_of_the_images_is_refused_by_any_of_its_names(tmp_path: Path) -> None:
    (tmp_path / "imgs").mkdir()
    (tmp_path / "link").symlink_to("imgs")
    for place in (tmp_path / "imgs", tmp_path / "link", tmp_path / "imgs" / ".." / "imgs"):
        with pytest.raises(UsageError, match=r"holds a\.png itself"):
            OverlayNames(place, [InputImage(tmp_path / "imgs" / "a.png", "a.png")])
