from __future__ import annotations

import os
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from circlepose_cli.console.process import use_one_thread

use_one_thread()

ROOT = Path(__file__).resolve().parent.parent
# At the end, for `tests` and `benchmarks` alone: what is tested is the installed package.
sys.path.append(str(ROOT))
for name in ("tests", "benchmarks"):
    # Some packages bring folders of these names into the same place as theirs.
    spec = spec_from_file_location(name, ROOT / name / "__init__.py", submodule_search_locations=[str(ROOT / name)])
    assert spec is not None
    sys.modules[name] = module_from_spec(spec)

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

from tests.support.json_outputs import check_captured  # noqa: E402

# A machine under load is slow, and a law that holds must hold for the same examples at every run of CI.
settings.register_profile("circlepose", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("circlepose")


def pytest_make_parametrize_id(val: object) -> str | None:
    """Of bytes, "bytes": some hold the time of day, and each process must give a test the same name."""
    return "bytes" if isinstance(val, bytes) else None


@pytest.fixture(autouse=True)
def _printed_json_is_valid(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever JSON the program prints in a test is what its schema says."""
    check_captured(monkeypatch)


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
