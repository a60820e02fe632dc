"""The program as it is installed: what is imported, and what is said where a package cannot be used."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import pytest

import circlepose
import circlepose_cli
from circlepose_cli.console.installation import broken_package
from tests.support.discs import disc_folder
from tests.support.processes import environment, run


def test_both_packages_are_of_one_installation(project_root):
    library, program = (Path(package.__file__).resolve().parent for package in (circlepose, circlepose_cli))
    of_checkout = library == project_root / "circlepose"
    assert program == (project_root / "cli" if of_checkout else library.parent) / "circlepose_cli"
    assert metadata.version("circlepose") == circlepose.__version__


def test_the_lowest_versions_are_those_that_are_declared(project_root):
    pinned = {}
    for line in (project_root / "constraints-lowest.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            name, version = line.split("==")
            pinned[name] = version
    declared = {}
    for requirement in metadata.requires("circlepose"):
        name, _, bound = requirement.partition(";")[0].strip().partition(">=")
        declared[name.partition("[")[0]] = bound
    for name in ("numpy", "scipy", "opencv-python-headless", "typer", "rich", "pyyaml", "pydantic", "pytest", "dask"):
        lowest = pinned[name].split(".")
        bound = declared[name].split(".")
        assert lowest[: len(bound)] == bound, name


BROKEN = {
    "an import that fails": ("raise ImportError('libGL.so.1: cannot open shared object file')", "libGL.so.1"),
    "a folder that is left of it": ("", "has no attribute"),
    "no memory": ("raise ImportError('cv2.so: failed to map segment from shared object')", "memory does not suffice"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_package_that_cannot_be_used_is_one_sentence(tmp_path, kind):
    content, words = BROKEN[kind]
    folder = disc_folder(tmp_path / "imgs")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "cv2.py").write_text(content)
    done = run("estimate", folder, env=environment(PYTHONPATH=str(tmp_path / "broken")))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("circlepose: ")
    assert done.stderr.count("\n") == 1
    assert "cv2" in done.stderr
    assert words in done.stderr
    assert "bug" not in done.stderr


def test_two_packages_that_own_cv2_are_named_with_what_mends_it(monkeypatch):
    owners = {"opencv-python": "4.10", "opencv-python-headless": "5.0"}

    def version(name):
        if name not in owners:
            raise metadata.PackageNotFoundError(name)
        return owners[name]

    monkeypatch.setattr(metadata, "version", version)
    message = broken_package(ImportError("bad", name="cv2"))
    assert "opencv-python and opencv-python-headless overwrite each other's files" in message
    assert "pip uninstall -y opencv-python opencv-python-headless" in message
    assert "pip install opencv-python-headless" in message


@pytest.mark.parametrize("error", [ValueError("x"), ImportError("x", name="circlepose.gone"), AttributeError("x")])
def test_what_is_no_broken_package_is_none(error):
    assert broken_package(error) is None
