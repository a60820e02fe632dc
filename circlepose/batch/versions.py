"""What a result depends on besides the image: the versions of what computes it."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib import metadata

import cv2
import numpy as np

from circlepose._version import __version__


def versions() -> dict[str, str]:
    """Return the versions of this process, by name."""
    return {
        "circlepose": __version__,
        "numpy": np.__version__,
        # Its import takes as long as that of OpenCV, and few runs need it.
        "scipy": metadata.version("scipy"),
        "opencv": cv2.__version__,
        "python": f"{sys.version_info[0]}.{sys.version_info[1]}",
    }


def difference(theirs: Mapping[str, str | None], ours: Mapping[str, str]) -> str:
    """Return in words how `theirs` differ, nothing where they do not; names that they lack are passed over."""
    return ", ".join(
        f"{name} {theirs[name] or 'not at all'} (here {version})"
        for name, version in ours.items()
        if name in theirs and theirs[name] != version
    )
