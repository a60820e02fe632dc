"""Python literals in files (of NumPy, mrcal): values, never code."""

from __future__ import annotations

import ast
import warnings


def python_literal(text: str) -> object:
    """Return the value of a literal; raises `ValueError` with a short reason. The caller bounds the length."""
    with warnings.catch_warnings():
        # Python warns on standard error of what looks like a slip, such as `1and`.
        warnings.simplefilter("ignore")
        try:
            return ast.literal_eval(text.strip())
        except SyntaxError as reason:
            raise ValueError(f"line {reason.lineno}") from None
        except (ValueError, TypeError, RecursionError, MemoryError):
            raise ValueError("not a literal") from None
