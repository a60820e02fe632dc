"""Damaged files of every format: a status or one sentence for each, never a crash, a hang, a traceback or noise.

A case that fails is named by format and number; `python -m benchmarks.fuzz --format NAME --case NUMBER` repeats it.
"""

from __future__ import annotations

import pytest

from benchmarks.fuzz import FAILURES, damaged, fuzz
from benchmarks.support.fuzz.arguments import formats as calls
from benchmarks.support.fuzz.formats import formats
from benchmarks.support.fuzz.mutations import generator
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.calibration.registry import FORMS
from circlepose.io.images.formats import JPEG_2000_VARIABLE

FORMATS = formats()
CALLS = calls()
TEXTS = ("calibration", "target", "table")
REFUSED = {"OpenPTV"}
"""forms that are recognized but never read"""


@pytest.mark.parametrize("name", FORMATS)
def test_what_is_damaged_was_sound_before(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(JPEG_2000_VARIABLE, "1")
    assert FORMATS[name].read(FORMATS[name].content, 0) == "read"


def test_each_form_of_a_calibration_is_fuzzed() -> None:
    contents = [format_.content for name, format_ in FORMATS.items() if name.startswith("calibration")]
    fuzzed = {read_camera_file(content).form for content in contents}
    assert fuzzed == {form.name for form in FORMS} - REFUSED


@pytest.mark.parametrize("name", CALLS)
def test_what_is_called_oddly_was_sound_before(name: str) -> None:
    assert CALLS[name].read(b"", 0) == "read"


@pytest.mark.parametrize("name", ["png 8", "png, checksums mended", "calibration, opencv"])
def test_a_case_is_made_from_its_name_and_number_alone(name: str) -> None:
    files = [damaged(FORMATS[name], name, number) for number in range(20)]
    assert files == [damaged(FORMATS[name], name, number) for number in range(20)]
    assert len(set(files)) > 15
    assert generator(name, 1).random() != generator("another", 1).random()


def test_the_fuzzer_sees_each_way_to_fail() -> None:
    found = fuzz([(name, number) for name in FAILURES for number in range(3)], "tests.support.fuzz_traps", hang_s=2.0)
    for name in FAILURES:
        assert found[name].counts == {"read": 2, name: 1}
        assert list(found[name].failures) == [1]
    assert "ZeroDivisionError: of one" in found["bug"].failures[1]
    assert "libfoo: warning\nand more" in found["printed"].failures[1]


def test_damaged_images() -> None:
    check([name for name in FORMATS if not name.startswith(TEXTS)], 150)


@pytest.mark.parametrize("kind", TEXTS)
def test_damaged_texts(kind: str) -> None:
    check([name for name in FORMATS if name.startswith(kind)], 120)


def test_odd_calls_of_the_library() -> None:
    check(list(CALLS), 60, "benchmarks.support.fuzz.arguments", least_read=0.02)


def test_damaged_journals_and_odd_places() -> None:
    check(["journal, checksums mended", "place of an output"], 150, "benchmarks.support.fuzz.outputs")


def check(
    names: list[str], cases: int, source: str = "benchmarks.support.fuzz.formats", least_read: float = 0.1
) -> None:
    found = fuzz([(name, number) for name in names for number in range(cases)], source)
    failures = {(name, case): text for name in names for case, text in found[name].failures.items()}
    assert not failures
    for name in names:
        assert found[name].counts.total() == cases
    counts = sum((found[name].counts for name in names), start=found[names[0]].counts.__class__())
    # Damage that is always, or never, noticed would test nothing.
    assert least_read < counts["read"] / counts.total() < 0.9
