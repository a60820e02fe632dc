from __future__ import annotations

import pytest

from circlepose_cli.app import main
from tests.support.discs import disc_folder
from tests.support.json_outputs import assert_valid_files


@pytest.fixture
def run(capsys):
    """Run a command line; returns exit code, standard output and standard error."""

    def run_it(*args):
        code = main([str(arg) for arg in args])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run_it


@pytest.fixture(autouse=True)
def _written_json_is_valid(request):
    """Whatever JSON the program writes in a test is what its schema says."""
    folder = request.getfixturevalue("tmp_path") if "tmp_path" in request.fixturenames else None
    yield
    if folder is not None:
        assert_valid_files(folder)


@pytest.fixture
def folder(tmp_path):
    """A folder of images of a disc, with their camera and target."""
    return disc_folder(tmp_path / "imgs")
