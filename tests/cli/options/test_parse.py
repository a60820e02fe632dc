from __future__ import annotations

import pytest

from circlepose.errors import UsageError
from circlepose_cli.options import parse


@pytest.mark.parametrize(
    ("read", "text", "value"),
    [
        (parse.count, "all", "all"),
        (parse.count, "7", 7),
        (parse.interval, "1:2.5", (1.0, 2.5)),
        (parse.direction, "0,-0.5,-1", (0.0, -0.5, -1.0)),
        (parse.camera_sigma, "0.8,0", (0.8, 0.0)),
        (parse.facing, "left", "left"),
        (parse.facing, "0,0,-2", (0.0, 0.0, -2.0)),
    ],
)
def test_texts_are_read(read, text, value):
    assert read("--x", text) == value


@pytest.mark.parametrize(
    ("read", "texts"),
    [
        (parse.count, ("", "0", "-1", "1.5", "some")),
        (parse.interval, ("", "1", "1:2:3", "2:1", "-1:2", "1:inf", "1:nan")),
        (parse.direction, ("", "1,2", "0,0,0", "1,2,nan", "1,2,inf", "a,b,c")),
        (parse.camera_sigma, ("", "1", "-1,0", "1,nan", "1,2,3")),
        (parse.facing, ("", "front", "0,0,0", "left,right")),
    ],
)
def test_a_text_that_cannot_be_read_is_refused_by_the_name_of_the_option(read, texts):
    for text in texts:
        with pytest.raises(UsageError, match=r"^--x: expected .*got " + repr(text)):
            read("--x", text)
