from __future__ import annotations

import os
from pathlib import Path

# As the command does before NumPy is there: sums in several threads differ in the last digit.
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

# A machine under load is slow, and a law that holds must hold for the same examples at every run of CI.
settings.register_profile("circlepose", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("circlepose")

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def project_root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of photographs and scenes with truth; it is not part of the project."""
    folder = Path(os.environ.get("CIRCLEPOSE_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no data at {folder}; name their folder in CIRCLEPOSE_DATA")
    return folder
