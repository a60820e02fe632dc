from __future__ import annotations

import pytest

from circlepose.io.text.literal import python_literal


def test_values_are_read() -> None:
    assert python_literal(" {'a': [1, 2.5, None], 'b': (3,)}\n") == {"a": [1, 2.5, None], "b": (3,)}


@pytest.mark.parametrize("text", ["", "{'a': ", "f()", "1and 2", "[" * 5000, "{[]: 1}", "a\0b", "(" * 90 + "1"])
def test_all_else_is_one_error_without_a_warning(text: str) -> None:
    with pytest.raises(ValueError, match=r"line|literal"):
        python_literal(text)
