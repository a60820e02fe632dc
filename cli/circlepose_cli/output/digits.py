"""How many digits of a number are worth reading: those that its standard deviation leaves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from circlepose.io.tables.columns import QUATERNION, Row, fixed

SIGMA_OF: Mapping[str, str] = {
    **{f"center_{axis}_mm": f"sigma_{axis}_mm" for axis in "xyz"},
    **{f"normal_{axis}": "sigma_normal_deg" for axis in "xyz"},
    **{f"{axis}_mm": f"sigma_{axis}_mm" for axis in "xyz"},
    **dict.fromkeys(("distance_mm", "sigma_mm"), "sigma_mm"),
    **dict.fromkeys(("angle_deg", "sigma_deg"), "sigma_deg"),
    **{name: name for name in ("sigma_x_mm", "sigma_y_mm", "sigma_z_mm", "sigma_normal_deg")},
    **{name: name for name in ("sigma_rx_deg", "sigma_ry_deg", "sigma_rz_deg")},
}
"""column that says how many digits of another one hold"""
_USUAL: Mapping[str, int] = {"mm": 3, "px": 2, "deg": 3}
_USUAL_WITHOUT_UNIT = 3
_USUAL_OF_NORMAL = 4
_MOST = 6
"""as many as the data formats have"""


def number_text(row: Row, column: str) -> str:
    """Return a number of a row for people: two digits of its sigma, or the usual digits where it has none."""
    value = row.get(column)
    if not isinstance(value, float):
        return "" if value is None else str(value)
    if column in QUATERNION:
        return fixed(value, quaternion_decimals(row))
    is_normal = column.startswith("normal_")
    usual = _USUAL_OF_NORMAL if is_normal else _USUAL.get(column.rpartition("_")[2], _USUAL_WITHOUT_UNIT)
    sigma = row.get(SIGMA_OF.get(column, ""))
    if not isinstance(sigma, float):
        return fixed(value, usual)
    if is_normal:
        return fixed(value, decimals(math.radians(sigma), usual))
    return fixed(value, decimals(sigma, usual))


def quaternion_decimals(row: Row) -> int:
    """Return how many decimals of a unit quaternion hold, by the standard deviations of its rotation."""
    sigmas = [sigma for axis in "xyz" if isinstance(sigma := row.get(f"sigma_r{axis}_deg"), float)]
    if len(sigmas) < 3:
        return _USUAL_OF_NORMAL
    # A turn by an angle changes the quaternion by half of it.
    return decimals(0.5 * math.radians(min(sigmas)), _USUAL_OF_NORMAL)


def decimals(sigma: float, usual: int = _USUAL["mm"]) -> int:
    """Return how many decimals show two digits of `sigma`; `usual` where it says nothing."""
    if not 0.0 < sigma < math.inf:
        return usual
    places = 1 - math.floor(math.log10(sigma))
    # 0.0999 is 0.10 in two digits.
    if round(sigma, places) >= 10.0 ** (2 - places):
        places -= 1
    return min(max(places, 0), _MOST)


def aligned(cells: Sequence[str]) -> list[str]:
    """Return numbers with spaces behind them so that, set flush right, their decimal points are in line."""
    behind = [len(cell) - cell.index(".") if "." in cell else 0 for cell in cells]
    most = max(behind, default=0)
    return [cell and cell + " " * (most - places) for cell, places in zip(cells, behind, strict=True)]
