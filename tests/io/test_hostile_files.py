"""Files that were made to hang or to fill the memory: one sentence and exit code 2, by each option that reads one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import cv2
import pytest

from circlepose.errors import TargetError, UsageError
from circlepose.io.text.source import MAX_BYTES, MAX_TABLE_BYTES, read_regular
from circlepose.targets.lengths import MAX_RADII
from circlepose.targets.target import Target
from tests.support.discs import disc_folder, found_notes
from tests.support.processes import SETTLE

COMMAND = [sys.executable, "-c", "import sys; from circlepose_cli.app import main; sys.exit(main())"]
POSIX = pytest.mark.skipif(os.name != "posix", reason="pipes and devices of POSIX")


def run(*args: object, text: str | None = None, **environment: str) -> tuple[int, str, str]:
    done = subprocess.run(
        [*COMMAND, *map(str, args)],
        input=text,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={**os.environ, **environment},
    )
    return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return disc_folder(tmp_path_factory.mktemp("a") / "imgs", 1)


EACH = """
import contextlib, io, json, sys
from circlepose_cli.app import main
for args in json.load(sys.stdin):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = main(args)
    print(json.dumps([code, out.getvalue(), err.getvalue()]))
"""


def run_each(commands: Iterable[list[object]]) -> list[tuple[int, str, str]]:
    """Run the commands in one process of their own, which may hang or die of memory."""
    texts = json.dumps([[str(arg) for arg in command] for command in commands])
    done = subprocess.run(
        [sys.executable, "-c", EACH], input=texts, capture_output=True, text=True, timeout=120, check=True
    )
    return [tuple(json.loads(line)) for line in done.stdout.splitlines()]


def reading(file: object, folder: Path, table: Path) -> dict[str, list[object]]:
    """Commands that read `file`, by what it is to be."""
    estimate: list[object] = ["estimate", folder]
    return {
        "--calib": [*estimate, "--calib", file],
        "--target": [*estimate, "--target", file],
        "--reference": [*estimate, "--layout", "table2", "--reference", file],
        "camera": ["camera", file],
        "render": ["render", file, "-o", folder / "new"],
        "check POSES": ["check", file, "--against", table],
        "check --against": ["check", table, "--against", file],
    }


@pytest.fixture(scope="module")
def table(folder: Path) -> Path:
    table = folder.parent / "poses.csv"
    assert run("estimate", folder, "-q", "-o", table)[0] == 0
    return table


@POSIX
@pytest.mark.parametrize("kind", ["device", "pipe", "huge"])
def test_what_never_ends_or_is_huge_is_refused_at_once(kind: str, folder: Path, table: Path, tmp_path: Path) -> None:
    file = Path("/dev/zero") if kind == "device" else tmp_path / kind
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "huge":
        with file.open("wb") as handle:
            # Without a byte on the disk.
            handle.truncate(1 << 40)
    commands = reading(file, folder, table)
    what = {
        "huge": "is larger than 10",
        "pipe": "is a pipe to which nothing writes; expected a file.",
        "device": "is a device; expected a regular file.",
    }[kind]
    for option, (code, out, err) in zip(commands, run_each(commands.values()), strict=True):
        assert (option, code, out) == (option, 2, "")
        assert err.startswith(f"circlepose: {file}: {what}")
        assert err.count("\n") == 1


@POSIX
def test_standard_input_without_an_end_is_bounded(table: Path) -> None:
    code = (
        "import sys; from circlepose_cli.runs import check; check.MAX_TABLE_BYTES = 10_000_000; "
        "from circlepose_cli.app import main; sys.exit(main())"
    )
    with Path("/dev/zero").open("rb") as endless:
        done = subprocess.run(
            [sys.executable, "-c", code, "check", "-", "--against", str(table)],
            stdin=endless,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "circlepose: standard input: is larger than 10 MB, the most that is read.\n"


def test_no_more_is_read_than_the_bound(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"a" * 1000)
    assert read_regular(str(file), UsageError, 1000) == b"a" * 1000
    with pytest.raises(UsageError, match="is larger than 0 MB"):
        read_regular(str(file), UsageError, 999)
    assert MAX_BYTES < MAX_TABLE_BYTES


@POSIX
def test_a_file_that_states_no_size_is_bounded_too() -> None:
    stated = Path("/proc/self/status")
    if not stated.exists():
        pytest.skip("there is no /proc here")
    assert read_regular(str(stated), UsageError, 100_000)
    with pytest.raises(UsageError, match="is larger than"):
        read_regular(str(stated), UsageError, 10)


@pytest.mark.parametrize("value", ['!!timestamp "abc"', '!!bool "maybe"', "!!set [1, 2]", "!!int {a: 1}"])
def test_a_tag_of_yaml_is_no_way_to_an_internal_error(value: str, folder: Path, table: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(f"a: 1\nradius_mm: {value}\n")
    commands = reading(file, folder, table)
    for code, out, err in run_each(commands[option] for option in ("--calib", "--target", "camera", "render")):
        assert (code, out) == (2, "")
        assert err.startswith(f"circlepose: {file}, line 2: is not valid YAML (")
        assert err.count("\n") == 1


def test_a_target_of_many_rings_is_refused_with_the_bound(folder: Path, tmp_path: Path) -> None:
    def rings(number: int) -> list[float]:
        return [100.0 - index for index in range(number)]

    assert len(Target("coplanar", tuple(rings(MAX_RADII))).radii_mm) == MAX_RADII
    with pytest.raises(TargetError, match=f"at most {MAX_RADII} radii, got {MAX_RADII + 1}"):
        Target("coplanar", tuple(rings(MAX_RADII + 1)))
    file = tmp_path / "rings.yaml"
    file.write_text(f"kind: coplanar\nradii_mm: {rings(50)}\n")
    code, out, err = run("estimate", folder, "--target", file)
    assert (code, out) == (2, "")
    assert err.startswith(f"circlepose: {file}: radii_mm: ")
    assert f"at most {MAX_RADII} radii, got 50" in err


@pytest.mark.parametrize("options", [[], ["--jobs", "1"]])
def test_jpeg_2000_needs_the_environment_which_workers_inherit(tmp_path: Path, options: list[str]) -> None:
    folder = disc_folder(tmp_path / "imgs", 1)
    image = cv2.imread(str(folder / "disc0.png"), cv2.IMREAD_UNCHANGED)
    (folder / "disc0.png").unlink()
    assert cv2.imwrite(str(folder / "disc.jp2"), image, [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, 1000])
    code, out, err = run("estimate", folder, *options, CIRCLEPOSE_JPEG2000="")
    assert code == 3
    assert "disc.jp2,,,,,,not_allowed," in out
    assert "set the environment variable CIRCLEPOSE_JPEG2000=1" in err
    code, out, err = run("estimate", folder, *options, CIRCLEPOSE_JPEG2000="1")
    assert (code, err) == (0, f"{found_notes(folder)}1 measured, 0 failed, 1 ambiguous: {SETTLE}\n")


def test_what_sets_the_scale_is_named_once_for_each_file(tmp_path: Path) -> None:
    first, second = disc_folder(tmp_path / "a", 1), disc_folder(tmp_path / "b", 1)
    (second / "target.yaml").write_text("{kind: coplanar, radii_mm: [50, 30]}\n")
    err = run("estimate", tmp_path, "-r")[2]
    notes = [line for line in err.splitlines() if "found beside" in line]
    assert notes == [
        *found_notes(first).splitlines(),
        f"{second}/camera.yaml: found beside the images and used as calibration",
        f"{second}/target.yaml: found beside the images and used as target, coplanar, radii_mm 50, 30",
    ]
    assert run("estimate", first, "--quiet")[2] == ""
    named = run("estimate", first, "--calib", first / "camera.yaml", "--target", first / "target.yaml")[2]
    assert named == f"1 measured, 0 failed, 1 ambiguous: {SETTLE}\n"
    # A calibration that was named brings a target that was not.
    calibration = tmp_path / "cam.yaml"
    calibration.write_text((first / "camera.yaml").read_text() + "target: {radius_mm: 77}\n")
    (first / "target.yaml").unlink()
    for command in (["estimate", first], ["explain", first / "disc0.png"]):
        err = run(*command, "--calib", calibration)[2]
        assert err.startswith(f"{calibration}: target: used as target, radius_mm 77\n")
