from __future__ import annotations

import json

import yaml
from hypothesis import given
from hypothesis import strategies as st

from circlepose.io.calibration.number_text import number_list_text, number_text

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@given(NUMBERS)
def test_every_language_reads_the_same_float(value: float) -> None:
    text = number_text(value)
    for read in (float(text), json.loads(text), yaml.safe_load(text)):
        assert type(read) is float
        assert read.hex() == value.hex()


@given(st.lists(NUMBERS, max_size=5))
def test_a_list(values: list[float]) -> None:
    assert yaml.safe_load(f"[{number_list_text(values)}]") == values
