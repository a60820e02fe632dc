"""The layout table2 with a reference: what is known of each circle, and how far the candidates are from it."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from circlepose.errors import UsageError
from circlepose.evaluation.matching import PoseTable, TabledCircle, TabledPose
from circlepose.io.tables.paper_layouts import (
    AMBIGUITY,
    ERROR_NUMBERS,
    POSE_NUMBERS,
    TABLE2_COLUMNS,
    TABLE2_ERRORS,
    write_results,
)
from circlepose.io.tables.reference import Reference, read_reference
from circlepose_cli.app import main
from tests.support.discs import CENTER_MM, NORMAL, disc_folder, made_circle, made_result


def truth(*circles: tuple[str, str | None, tuple[float, float, float] | None]) -> Reference:
    """A truth of (image, circle, centre)."""
    made = (
        TabledCircle(image, None, circle, None, poses=(TabledPose(center, tuple(NORMAL)),))
        for image, circle, center in circles
    )
    return Reference.of(PoseTable(tuple(made), {}, is_truth=True))


def rows(results, reference, data_format="csv"):
    handle = io.StringIO()
    write_results(results, handle, data_format=data_format, layout="table2", reference=reference)
    if data_format == "csv":
        return list(csv.DictReader(io.StringIO(handle.getvalue())))
    return json.loads(handle.getvalue())["rows"]


def moved(by):
    x, y, z = CENTER_MM + np.array(by)
    return float(x), float(y), float(z)


def test_errors_are_the_distance_and_the_angle_and_the_reference_follows():
    chosen, other, known = rows([made_result()], truth(("a.png", "disc", moved((0.0, 0.3, 0.4)))))
    assert (chosen["Candidate"], other["Candidate"], known["Candidate"]) == ("chosen", "other", "reference")
    # As in Table 1 of Fu & Zhou: components without signs. The numbers for programs have them.
    assert (chosen["TV error (mm)"], chosen["UN error (deg)"]) == ("(0.000, 0.300, 0.400)", "0.000")
    assert [chosen[name] for name in ERROR_NUMBERS] == ["0.000000", "-0.300000", "-0.400000", "0.500000"]
    second = made_circle().candidates[1]
    assert float(other["UN error (deg)"]) == pytest.approx(np.degrees(np.arccos(second.normal @ NORMAL)), abs=1e-3)
    assert float(other["center_error_mm"]) == pytest.approx(
        np.linalg.norm(second.center - moved((0, 0.3, 0.4))), abs=1e-3
    )
    assert known["TV"] == "(10.0000, -4.7000, 200.4000)"
    assert known["UN"] == chosen["UN"]
    assert known["TV error (mm)"] == known["GCC"] == ""


def test_columns_of_errors_are_there_with_a_reference_only():
    numbers = [AMBIGUITY, *POSE_NUMBERS]
    assert list(rows([made_result()], None)[0]) == [*TABLE2_COLUMNS, *numbers]
    assert list(rows([made_result()], truth(("a.png", "disc", None)))[0]) == [
        *TABLE2_COLUMNS,
        *TABLE2_ERRORS,
        *numbers,
        *ERROR_NUMBERS,
    ]


def test_json_holds_numbers_lists_and_nulls():
    chosen, _, known = rows([made_result()], truth(("a.png", "disc", moved((3.0, 0.0, 4.0)))), "json")
    assert chosen["TV error (mm)"] == pytest.approx([3.0, 0.0, 4.0])
    assert [chosen[name] for name in ERROR_NUMBERS] == pytest.approx([-3.0, 0.0, -4.0, 5.0])
    assert [known[name] for name in POSE_NUMBERS] == pytest.approx([*moved((3.0, 0.0, 4.0)), *NORMAL])
    assert known["UN"] == pytest.approx(NORMAL)
    assert known["TV error (mm)"] is None


def test_an_unknown_centre_leaves_the_normals_error():
    chosen, _, known = rows([made_result()], truth(("a.png", "disc", None)))
    assert (chosen["TV error (mm)"], chosen["UN error (deg)"], known["TV"]) == ("", "0.000", "")


def test_images_are_known_by_name_or_by_file_name():
    reference = truth(("set/a.png", "disc", moved((0, 0, 1))), ("x/c.png", "disc", None), ("y/c.png", "disc", None))
    assert rows([made_result()], reference)[0]["center_error_mm"] == "1.000000"
    assert rows([made_result(image="b.png")], reference)[0]["TV error (mm)"] == ""
    assert len(rows([made_result(image="b.png")], reference)) == 2
    assert not reference.knows("c.png")


def test_several_targets_are_matched_by_their_centres():
    left, right = made_circle(0), made_circle(1, CENTER_MM + np.array([50.0, 0.0, 0.0]))
    reference = truth(("a.png", "disc", moved((50.0, 0.0, 2.0))), ("a.png", "disc", moved((0.0, 1.0, 0.0))))
    errors = [r["center_error_mm"] for r in rows([made_result(left, right)], reference) if r["Candidate"] == "chosen"]
    assert errors == ["1.000000", "2.000000"]


def test_the_generatrix_of_the_reference_needs_both_circles():
    big = made_circle(circle="big")
    small = replace(made_circle(circle="small", center=CENTER_MM + 12.0 * NORMAL), radius_mm=15.0)
    x, y, z = CENTER_MM + 12.0 * NORMAL
    both = truth(("a.png", "big", moved((0, 0, 0))), ("a.png", "small", (x, y, z)))
    assert rows([made_result(big, small)], both)[-1]["GCC"] == "13.00"
    one = truth(("a.png", "big", moved((0, 0, 0))))
    assert rows([made_result(big, small)], one)[-1]["GCC"] == ""


def test_what_is_no_reference_is_refused(tmp_path):
    with pytest.raises(UsageError, match="there is no such file"):
        read_reference(tmp_path / "gone.csv")
    with pytest.raises(UsageError, match="is a folder"):
        read_reference(tmp_path)
    (tmp_path / "a.csv").write_text("image,u,v\na.png,1,2\n")
    with pytest.raises(UsageError, match=r"a\.csv: has no column"):
        read_reference(tmp_path / "a.csv")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for library in ("OPENBLAS", "OMP", "MKL"):
        monkeypatch.setenv(f"{library}_NUM_THREADS", "1")
    return disc_folder(tmp_path / "imgs", images=1)


def write_truth(folder, image):
    x, y, z = CENTER_MM
    nx, ny, nz = NORMAL
    (folder / "truth.csv").write_text(f"image,x,y,z,nx,ny,nz\n{image},{x},{y},{z},{nx:.9f},{ny:.9f},{nz:.9f}\n")
    return str(folder / "truth.csv")


def test_the_option(folder, capsys):
    reference = write_truth(folder, "disc0.png")
    for output_format in ("csv", "table"):
        args = ["--layout", "table2", "--reference", reference, "--format", output_format]
        assert main(["estimate", str(folder), *args]) == 0
        out = capsys.readouterr().out
        assert "TV error (mm)" in out.replace("\n", " ") or "TV error" in out
        assert "reference" in out
    assert main(["estimate", str(folder), *args[:-1], "csv"]) == 0
    first, second, _ = csv.DictReader(io.StringIO(capsys.readouterr().out))
    assert min(float(first["center_error_mm"]), float(second["center_error_mm"])) < 0.5


def test_misuse_of_the_option(folder, capsys):
    reference = write_truth(folder, "other.png")
    for args, message in (
        (["--reference", reference], "--reference: goes with --layout table2"),
        (["--reference", reference, "--layout", "table2"], "has none of the images; it names other.png"),
    ):
        assert main(["estimate", str(folder), *args]) == 2
        captured = capsys.readouterr()
        assert message in captured.err
        assert captured.out == ""
