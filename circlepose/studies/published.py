"""The numbers that the two papers print, as they stand there: mm and deg.

Chen & Huang 1999: Table I and the noise experiment, both in section IV. Fu & Zhou 2019: Tables 1 and 2. What
the papers leave open, and how it is read here, is said in docs/papers.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Triple: TypeAlias = tuple[float, float, float]
PrintedMethod = Literal["Our method", "K and L's method", "K and A's method"]


@dataclass(frozen=True, slots=True)
class PrintedPose:
    """A row of Table I of Chen & Huang."""

    method: PrintedMethod
    image: str
    center_mm: Triple
    normal: Triple
    position_difference_mm: float | None = None
    """to `Our method` in the same image"""
    orientation_difference_deg: float | None = None


TABLE1: tuple[PrintedPose, ...] = (
    PrintedPose("Our method", "a", (-14.86, 31.54, 902.38), (0.00, -0.97, -0.24)),
    PrintedPose("Our method", "b", (-3.58, 41.95, 935.47), (-0.01, -1.00, -0.02)),
    PrintedPose("Our method", "c", (-14.86, 31.54, 902.38), (-0.01, -0.97, -0.24)),
    PrintedPose("K and L's method", "a", (-14.91, 31.66, 902.46), (-0.01, -0.97, -0.25), 0.15, 0.43),
    PrintedPose("K and L's method", "b", (-3.53, 41.16, 916.66), (-0.01, -1.00, -0.02), 18.83, 0.15),
    PrintedPose("K and L's method", "c", (-18.61, 28.88, 919.65), (0.02, -0.95, -0.31), 17.87, 4.15),
    PrintedPose("K and A's method", "a", (-14.44, 31.57, 872.42), (-0.01, -0.96, -0.28), 29.96, 2.45),
    PrintedPose("K and A's method", "b", (-3.42, 39.97, 886.66), (-0.01, -1.00, -0.07), 48.85, 2.68),
    PrintedPose("K and A's method", "c", (-18.05, 29.05, 888.96), (0.01, -0.94, -0.34), 14.02, 5.88),
)


@dataclass(frozen=True, slots=True)
class PrintedNoise:
    """Standard deviations under Gaussian noise on the feature points, Chen & Huang."""

    noise_px: float
    center_sd_mm: float
    normal_sd_deg: float


NOISE: tuple[PrintedNoise, ...] = (
    PrintedNoise(1.0, 6.29, 1.63),
    PrintedNoise(2.0, 12.91, 3.10),
    PrintedNoise(3.0, 18.63, 4.61),
)
NOISE_REPEATS = 1000


@dataclass(frozen=True, slots=True)
class PrintedCandidate:
    """One pose in Tables 1 and 2 of Fu & Zhou; the printed unit normals point away from the camera."""

    normal: Triple
    """UN"""
    center_mm: Triple
    """TV"""
    generatrix_mm: float | None = None
    """GCC"""


@dataclass(frozen=True, slots=True)
class PrintedScene:
    """A scene of Fu & Zhou: 1a to 1d of Table 1 (coplanar), 2a and 2b of Table 2 (coaxial)."""

    scene: str
    measured: tuple[PrintedCandidate, ...]
    """the right candidate first; Table 1 prints no other"""
    calibrated: PrintedCandidate


TABLES_1_AND_2: tuple[PrintedScene, ...] = (
    PrintedScene(
        "1a",
        (PrintedCandidate((-0.1065, -0.0859, 0.9907), (168.1180, -43.8985, 698.1721)),),
        PrintedCandidate((-0.1097, -0.0832, 0.9905), (170.1304, -43.6831, 701.7931)),
    ),
    PrintedScene(
        "1b",
        (PrintedCandidate((0.0127, -0.0768, 0.9970), (-56.2672, -43.0540, 700.0083)),),
        PrintedCandidate((0.0159, -0.0755, 0.9970), (-54.5512, -42.2011, 703.9146)),
    ),
    PrintedScene(
        "1c",
        (PrintedCandidate((0.5019, -0.1250, 0.8558), (-138.5390, -10.0868, 746.7406)),),
        PrintedCandidate((0.5020, -0.1244, 0.8559), (-136.4270, -9.1214, 749.3097)),
    ),
    PrintedScene(
        "1d",
        (PrintedCandidate((0.4712, -0.1864, 0.8621), (144.6577, -7.4181, 735.9604)),),
        PrintedCandidate((0.4729, -0.1839, 0.8617), (146.3175, -6.9782, 738.8505)),
    ),
    PrintedScene(
        "2a",
        (
            PrintedCandidate((0.2341, -0.1647, 0.9582), (29.5012, -8.6430, 712.1488), 46.98),
            PrintedCandidate((-0.2097, -0.0870, 0.9739), (25.8187, -7.6664, 712.2697), 40.24),
        ),
        PrintedCandidate((0.2370, -0.1609, 0.9581), (30.7920, -8.9972, 714.3658), 45.12),
    ),
    PrintedScene(
        "2b",
        (
            PrintedCandidate((0.2201, -0.1556, 0.9630), (-158.0637, -9.0703, 707.3917), 45.70),
            PrintedCandidate((-0.2056, -0.0694, 0.9762), (-154.6250, -8.6151, 707.5062), 41.96),
        ),
        PrintedCandidate((0.2229, -0.1521, 0.9629), (-159.5591, -9.5237, 709.5169), 45.33),
    ),
)
GENERATRIX_MM = 45.21
"""of the part in Table 2"""
