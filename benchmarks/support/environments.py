"""Packages that are compared with, each in a virtual environment of its own, which is thrown away afterwards.

They are given images as .npy files in a folder and answer in JSON: for each image a list of rows that start with the
time taken in ms.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

EDGE_DRAWING = "opencv-contrib-python-headless==5.0.0.93"
NAPA_VISION = "napa-vision[headless]==0.4.1"
PYE3D = "pye3d==0.3.2"
RINGGRID = "ringgrid==0.13.1"
SCIKIT_IMAGE = "scikit-image==0.26.0"
_SCRIPT = Path(__file__).resolve().with_name("elsewhere.py")
Rows = list[list[list[float]]]
"""by image, by what was found on it"""


class NotInstalledError(Exception):
    """pip does not get a package."""


@contextmanager
def environment(*requirements: str) -> Iterator[str]:
    """Make an environment with `requirements`, and give its interpreter; it is removed at the end."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "environment"
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        python = str(folder / ("Scripts" if sys.platform == "win32" else "bin") / "python")
        install = [python, "-m", "pip", "install", "--quiet", *requirements]
        if subprocess.run(install, capture_output=True, check=False).returncode != 0:
            raise NotInstalledError(f"{', '.join(requirements)} is left out: pip cannot install it here.")
        yield python


def answers(python: str, way: str, arrays: Sequence[np.ndarray], options: Mapping[str, Any] | None = None) -> Rows:
    """Run `elsewhere.py` by another interpreter: what a `way` makes of `arrays`."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, array in enumerate(arrays):
            np.save(folder / f"{number:04d}.npy", array)
        (folder / "options.json").write_text(json.dumps(options or {}))
        # Isolated: our own packages and modules are not to be found from there.
        done = subprocess.run([python, "-I", _SCRIPT, way, folder], capture_output=True, text=True, check=True)
    rows: Rows = json.loads(done.stdout)
    return rows
