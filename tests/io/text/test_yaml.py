from __future__ import annotations

import io
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.errors import CalibrationError, TargetError
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.text import yaml
from circlepose.io.text.source import MAX_BYTES, read_source
from circlepose.io.text.yaml import MatrixNode, parse_yaml


def parse(text: str) -> dict[str, object]:
    return parse_yaml(text, "f.yaml", CalibrationError)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_float_that_python_writes_is_read_back(value: float) -> None:
    assert parse(f"a: {value!r}")["a"] == value


@pytest.mark.parametrize("text", [".Inf", "-.Inf", ".inf", "+.INF"])
def test_infinities_as_opencv_and_yaml_write_them(text: str) -> None:
    assert parse(f"a: {text}")["a"] == math.copysign(math.inf, -1 if text[0] == "-" else 1)


@pytest.mark.parametrize("text", [".Nan", ".nan", ".NaN", ".NAN"])
def test_nan_as_opencv_and_yaml_write_it(text: str) -> None:
    value = parse(f"a: {text}")["a"]
    assert isinstance(value, float)
    assert math.isnan(value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("1.", 1.0),
        (".5", 0.5),
        ("-1E+5", -1e5),
        ("010", 10),
        ("1:30", "1:30"),
        ("no", "no"),
        ("true", True),
        ("~", None),
        ("2024-01-01", "2024-01-01"),
        ("60 mm", "60 mm"),
        ("60,5", "60,5"),
        ('"1"', "1"),
    ],
)
def test_plain_values_mean_what_they_look_like(text: str, value: object) -> None:
    read = parse(f"a: {text}")["a"]
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    "header", ["", "%YAML:1.0\n", "%YAML:1.0\n---\n", "%YAML 1.2\n---\n", "%YAML 1.1\r\n---\r\n"]
)
def test_headers_of_every_opencv_are_taken(header: str) -> None:
    assert parse(f"{header}a: 1\n") == {"a": 1}


def test_opencv_matrix_tag() -> None:
    matrix = parse("m: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: d\n   data: [ 1., 2. ]\n")["m"]
    assert isinstance(matrix, MatrixNode)
    assert matrix == {"rows": 1, "cols": 2, "dt": "d", "data": [1.0, 2.0]}


def test_the_closing_line_of_a_recorded_message_is_no_second_document() -> None:
    assert parse("a: 1\n---\n") == {"a": 1}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: 1\nb: 2\na: 3\n", "line 3: .*'a' is given twice"),
        ("%YAML:1.0\n---\nb:\n  a: 1\n  a: 3\n", "line 5: .*'a' is given twice"),
        ("a: [1, 2\n", "is not valid YAML"),
        ("a: !!python/object/apply:os.system ['true']\n", "is not valid YAML"),
        ("a: !!opencv-matrix 3\n", "rows, cols, dt and data"),
        ("a: 1\n---\nb: 2\n", "holds 2 YAML documents"),
        ("[1, 2]\n", "expected keys and values"),
        ("just words\n", "expected keys and values"),
        ("# a remark\n", "expected keys and values"),
        ("? [1]\n: 2\n", "is not valid YAML"),
        (f"a: {'9' * 5000}\n", "is not valid YAML"),
        (f"a: {'[' * 5000}\n", "nested too deeply"),
        ("a: &x [*x]\nb: *y\n", "line 1: .*a value holds itself"),
        ("a: &x {b: *x}\n", "line 1: .*a value holds itself"),
        ("a: \x07\n", "is not valid YAML"),
    ],
)
def test_what_is_no_mapping_is_told_with_its_line(text: str, says: str) -> None:
    with pytest.raises(CalibrationError, match=says) as caught:
        parse(text)
    assert str(caught.value).startswith("f.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty"),
        (b" \n\t\n", "is empty"),
        (b"\x00\x01\x02", "binary"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "binary"),
        (b"\x1f\x8b\x08", "binary"),
        (b"name: M\xfcller", "is not UTF-8 text .byte 7."),
        (b"a" * (MAX_BYTES + 1), "larger than 10 MB"),
    ],
)
def test_files_that_cannot_be_meant(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "f.yaml"
    path.write_bytes(content)
    for source in (path, str(path), content):
        with pytest.raises(TargetError, match=says):
            read_source(source, TargetError)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"none\.yaml: there is no such file"):
        read_source(tmp_path / "none.yaml", CalibrationError)
    with pytest.raises(CalibrationError, match="is a folder"):
        read_source(tmp_path, CalibrationError)
    with pytest.raises(CalibrationError, match="cannot be opened"):
        read_source("a\0b", CalibrationError)
    with pytest.raises(CalibrationError, match="cannot be opened"):
        read_source("x" * 5000, CalibrationError)


def alias_bomb(levels: int) -> str:
    """Ten names of ten names of ... ten letters."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 10)}]" for level in range(1, levels)]
    return "\n".join(lines) + "\n"


def test_a_bomb_of_aliases_is_refused_by_what_it_stands_for() -> None:
    with pytest.raises(CalibrationError, match=r"^f\.yaml, line 5: is not valid YAML \(it holds more than"):
        parse(alias_bomb(9))
    # By way of merged keys, too.
    merged = "a: &a {x: 1}\n" + "".join(f"!!merge m{n}: &m{n} {{!!merge x: *a}}\n" for n in range(9))
    assert parse(merged)["x"] == 1


def test_more_values_than_anyone_means(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml, "MAX_VALUES", 100)
    assert len(parse(f"a: [{'1,' * 96}]\n")) == 1
    with pytest.raises(CalibrationError, match="holds more than 100 values"):
        parse(f"a: [{'1,' * 100}]\n")


CORE_TAGS = ("null", "bool", "int", "float", "str", "seq", "map")
OTHER_TAGS = (
    "timestamp",
    "binary",
    "set",
    "omap",
    "pairs",
    "merge",
    "value",
    "yaml",
    "opencv-matrix",
    "opencv-nd-matrix",
)
VALUES = st.one_of(
    st.sampled_from(
        ["abc", "maybe", "1", "1e400", "''", "~", "true", "2024-01-01", "[]", "{}", "[1, 2]", "[[1, 2]]"]
    ),
    st.sampled_from(
        ["[{a: 1}]", "{a: 1}", "{a: , b: }", "{? [1] : 2}", "[a: 1, a: 2]", "{rows: 1, cols: 1}", "*a", "<<"]
    ),
    st.text("abc 01:.-+e", max_size=6),
)


@given(st.sampled_from([*CORE_TAGS, *OTHER_TAGS]), VALUES, st.sampled_from(["{v}", "a: {v}", "a: [{v}]", "{v}: 1"]))
def test_a_tag_before_a_value_of_another_kind_is_one_sentence(tag: str, value: str, form: str) -> None:
    text = form.format(v=f"!!{tag} {value}")
    try:
        parse(text)
    except CalibrationError as error:
        message = str(error)
        assert message.startswith("f.yaml")
        assert "\n" not in message


@pytest.mark.parametrize("value", ['!!timestamp "abc"', '!!bool "maybe"', "!!set [1, 2]", "!!int [1]", "!!map [1]"])
def test_a_tag_that_does_not_fit_is_refused_with_its_line(value: str) -> None:
    with pytest.raises(CalibrationError, match=r"^f\.yaml, line 2: is not valid YAML \("):
        parse(f"a: 1\nb: {value}\n")


def test_the_tags_of_the_core_say_what_a_value_is() -> None:
    text = 'a: !!str 1\nb: !!int "2"\nc: !!float "3"\nd: !!bool "true"\ne: !!null ""\nf: !!seq [1]\ng: !!map {h: 1}\n'
    assert parse(text) == {"a": "1", "b": 2, "c": 3.0, "d": True, "e": None, "f": [1], "g": {"h": 1}}


def test_values_are_bounded_by_what_the_parser_at_hand_can_read_soon() -> None:
    # PyYAML's own parser takes half a minute for 150 000.
    assert issubclass(yaml._Loader, yaml._PlainParser) is (yaml.MAX_VALUES < 100_000)


def test_a_text_longer_than_the_parser_reads_soon_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml, "MAX_CHARACTERS", 100)
    with pytest.raises(CalibrationError, match="has more than 100 characters"):
        parse(f"a: 1\n#{'x' * 100}")


def test_messages_quote_no_bomb() -> None:
    for key in ("target", "camera_model", "distortion_model", "camera_matrix", "cam0", "camera_name", "binning_x"):
        content = f"{alias_bomb(4)}cam1: {{intrinsics: [1], camera_model: *a3}}\n{key}: *a3\nK: [1]\n"
        with pytest.raises(CalibrationError) as caught:
            read_camera_file(content.encode())
        assert len(str(caught.value)) < 1000
    with pytest.raises(CalibrationError) as caught:
        read_camera_file(f"{'k' * 100_000}: 1\n".encode())
    assert len(str(caught.value)) < 1000


def test_aliases_as_they_are_meant_are_read() -> None:
    assert parse("cam0: &c {a: 1}\ncam1: *c\n") == {"cam0": {"a": 1}, "cam1": {"a": 1}}


def test_a_text_without_end_is_looked_through_once() -> None:
    # Sought again from each of its quotes, the end of this one would take minutes.
    for end in ("", "\\", "\\\n"):
        with pytest.raises(CalibrationError):
            read_camera_file(('{"a": "' + '\\"' * 100_000 + end).encode())


def test_handles_and_a_byte_order_mark() -> None:
    assert read_source(io.StringIO("a: 1"), CalibrationError) == ("a: 1", "<stream>")
    assert read_source(io.BytesIO(b"\xef\xbb\xbfa: 1"), CalibrationError) == ("a: 1", "<stream>")
