"""Text under a key that needs numbers: `"[0.1, 0.2]"`, `dist.npy`. Passed over, it would be no distortion."""

from __future__ import annotations

import re
from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.errors import CalibrationError
from circlepose.io.calibration.keys import DISTORTION_ROLES, Field, field_of

_SOME_NUMBERS = re.compile(r"(?=\D*\d)[\s\d.,;eE+\-\[\](){}]+")
_FILE_NAME = re.compile(r"[^\n]{1,300}\.(?:txt|npy|npz|csv|ya?ml|json|xml|mat|bin|dat|pkl)", re.IGNORECASE)


def check_text(field: Field, where: str, expected: Mapping[str, str]) -> None:
    """Refuse text that holds, or names a file of, a matrix or coefficients; and `fx = 905,5`.

    `expected` completes the sentence, by role. Raises `CalibrationError`.
    """
    if not field.role and field.name in ("fx", "fy", "cx", "cy") and isinstance(field.value, list):
        raise CalibrationError(
            f"{where}: {field.path}: expected a number, with a point and not a comma, got {shown(field.value)}."
        )
    if field.role or not isinstance(field.value, str):
        return
    group, _, key = field.path.rpartition(".")
    role = field_of(key, [0.0, 0.0], field.path, group.rpartition(".")[2]).role
    if role == "matrix" or role in DISTORTION_ROLES:
        is_needed = role != "matrix" or _SOME_NUMBERS.fullmatch(field.value)
        if is_needed and (_SOME_NUMBERS.fullmatch(field.value) or _FILE_NAME.fullmatch(field.value)):
            raise CalibrationError(
                f"{where}: {field.path}: expected {expected.get(role, '[k1, k2, p1, p2, k3]')}, got the text "
                f"{shown(field.value)}; write the numbers here as a list, without quotes."
            )
