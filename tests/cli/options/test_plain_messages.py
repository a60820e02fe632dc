"""A value that cannot be read is reported in the words of the manual, whatever reads it."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        ("estimate x --jobs many", "'--jobs'"),
        ("estimate x --jobs 1.5", "'--jobs'"),
        ("estimate x --jobs 0", "'--jobs'"),
        ("estimate x --timeout soon", "'--timeout'"),
        ("estimate x --radius-mm 6cm", "expected a number of mm without its unit, such as 60, got '6cm'."),
        ("estimate x --normal-spread-deg wide", "'--normal-spread-deg'"),
        ("estimate x --method x", "'x' is not one of 'chen-huang', 'chen-huang-contour', "),
        ("estimate x --stdin x", "'x' is not one of 'auto', 'paths', 'image'."),
        ("estimate x --polarity pink", "'pink' is not one of 'any', 'dark', 'bright'."),
        ("check a --against b --position-mm far", "'--position-mm'"),
        ("check a --against b --format x", "'x' is not one of 'csv', "),
        ("study noise --seed x", "'--seed'"),
        ("study noise --repeats 1", "'--repeats'"),
        ("study gcc --scenes 99999999999999999999999999999999999999999999999x", "'--scenes'"),
    ],
)
def test_a_value_that_cannot_be_read(run, typed, message):
    code, out, err = run(*typed.split())
    assert (code, out) == (2, "")
    assert message in err
    assert not [words for words in ("Value error", "Input should", "parse string", "Traceback") if words in err]
