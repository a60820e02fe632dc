"""`circlepose print`: sheets in true size, the target beside them, and files that are not to be lost."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

import circlepose
from benchmarks.support.sheet_rasters import svg_pixels
from circlepose.boards.pose import rotation_of
from circlepose.errors import TargetError
from circlepose.io.calibration.reader import write_camera
from circlepose.io.marks import bears_mark
from circlepose.io.target_file import read_target, target_from_mapping
from circlepose.io.text.yaml import parse_yaml
from circlepose.sheets import code, dxf, pdf

DISC = "radius_mm: 60\n"
RING = "kind: coplanar\nradii_mm: [50, 30]\n"
BOARD = "kind: board\nradius_mm: 8\ngrid: {pattern: symmetric, rows: 4, columns: 5, spacing_mm: 30}\n"
LIST = """kind: board
circles:
- {name: a, x_mm: 0, y_mm: 0, radius_mm: 12}
- {name: b, x_mm: 80, y_mm: 15, radius_mm: 9}
- {name: c, x_mm: 20, y_mm: 60, radius_mm: 10}
- {name: d, x_mm: 90, y_mm: 70, radius_mm: 7}
"""


@pytest.fixture
def target(tmp_path):
    def write(text, name="target.yaml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def photograph(sheet, folder, tilt_deg=35.0, roll_deg=20.0, distance_mm=420.0):
    """Take a picture of an SVG sheet; returns the camera's file and the pose of the sheet's top left corner."""
    content = sheet.read_bytes()
    wide, high = (float(each) for each in re.search(rb'viewBox="0 0 (\S+) (\S+)"', content).groups())
    per_mm = 10.0
    flat = svg_pixels(content, per_mm)
    size = (1600, 1200)
    camera = circlepose.Camera.create([[1800.0, 0, 799.5], [0, 1800.0, 599.5], [0, 0, 1]], (0, 0, 0, 0), size)
    rotation = rotation_of(np.radians(tilt_deg) * np.array([0.8, 0.6, 0.0])) @ rotation_of(
        np.array([0.0, 0.0, np.radians(roll_deg)])
    )
    corner = np.array([0.0, 0.0, distance_mm]) - rotation @ [wide / 2.0, high / 2.0, 0.0]
    to_mm = np.array([[1.0 / per_mm, 0, 0.5 / per_mm], [0, 1.0 / per_mm, 0.5 / per_mm], [0, 0, 1.0]])
    matrix = (
        np.array(((1800.0, 0, 799.5), (0, 1800.0, 599.5), (0, 0, 1.0)))
        @ np.column_stack([rotation[:, :2], corner])
        @ to_mm
    )
    # Three times as large, then averaged, so that it has no steps.
    finer = np.array([[3.0, 0, 1.0], [0, 3.0, 1.0], [0, 0, 1.0]])
    large = cv2.warpPerspective(flat, finer @ matrix, (3 * size[0], 3 * size[1]), borderValue=255)
    image = cv2.resize(large, size, interpolation=cv2.INTER_AREA).astype(np.float64) * 0.6 + 40.0
    image = cv2.GaussianBlur(image, (0, 0), 0.6) + np.random.default_rng(3).normal(0.0, 1.5, image.shape)
    folder.mkdir()
    cv2.imwrite(str(folder / "photo.png"), np.clip(image.round(), 0, 255).astype(np.uint8))
    write_camera(camera, folder / "camera.yaml")
    return camera, rotation, corner


def circles_of(sheet):
    """Centers and radii by name of an SVG sheet, mm."""
    found = re.findall(r'<circle cx="(\S+)" cy="(\S+)" r="(\S+)" fill="\S+"><title>(.*?)</title>', sheet.read_text())
    return {name: tuple(map(float, each)) for *each, name in found}


def test_a_disc_is_a_circle_in_mm_with_its_target_beside_it(run, tmp_path, target):
    code_, out, err = run("print", target(DISC), "-o", tmp_path / "sheet.svg")
    assert code_ == 0
    assert out.splitlines() == [str(tmp_path / "sheet.svg"), str(tmp_path / "sheet.yaml")]
    assert err.splitlines()[-1].strip() == (
        f"circlepose estimate photos/ --calib cam.yaml --target {tmp_path / 'sheet.yaml'}"
    )
    content = (tmp_path / "sheet.svg").read_text()
    width, height = re.search(r'width="(\S+)mm" height="(\S+)mm" viewBox="0 0 (\S+) (\S+)"', content).group(1, 2)
    assert f'viewBox="0 0 {width} {height}"' in content
    assert circles_of(tmp_path / "sheet.svg")["disc"][2] == 60.0
    printed = read_target(tmp_path / "sheet.yaml")
    assert (printed.kind, printed.radii_mm, printed.polarity) == ("circle", (60.0,), "dark")


@pytest.mark.parametrize("form", ["svg", "pdf", "dxf"])
def test_every_form_is_written_bears_the_mark_and_is_replaced(run, tmp_path, target, form):
    pytest.importorskip("reportlab")
    pytest.importorskip("ezdxf")
    sheet = tmp_path / f"sheet.{form}"
    for _ in range(2):
        code_, _, err = run("print", target(RING), "-o", sheet)
        assert code_ == 0, err
        assert bears_mark(sheet)
        assert bears_mark(tmp_path / "sheet.yaml")


@pytest.mark.parametrize("text", [RING, BOARD, LIST], ids=["ring", "board", "list"])
@pytest.mark.parametrize("light", [False, True], ids=["dark", "bright"])
def test_a_photograph_of_the_sheet_is_measured_by_the_target_beside_it(run, tmp_path, target, text, light):
    pytest.importorskip("resvg_py")
    run("print", target(text), "-o", tmp_path / "sheet.svg", *(["--light-on-dark"] if light else []))
    camera, rotation, corner = photograph(tmp_path / "sheet.svg", tmp_path / "photos")
    found = circlepose.estimate(
        circlepose.read_image(tmp_path / "photos" / "photo.png"), camera, read_target(tmp_path / "sheet.yaml")
    )
    assert found.reason == ""
    drawn = circles_of(tmp_path / "sheet.svg")
    for circle in found.circles:
        # Concentric circles are drawn under one name.
        name = "outer" if circle.circle == "inner" else circle.circle
        true = corner + rotation @ [*drawn[name][:2], 0.0]
        assert np.linalg.norm(circle.pose.center - true) < 0.3
        assert np.degrees(np.arccos(np.clip(circle.pose.normal @ -rotation[:, 2], -1, 1))) < 0.2
    for board in found.boards:
        assert np.degrees(np.linalg.norm(board.pose.rotation @ rotation.T - np.eye(3))) < 0.3


def test_the_roll_of_a_board_is_settled_unless_it_is_not_wanted(run, tmp_path, target):
    _, _, err = run("print", target(BOARD), "-o", tmp_path / "a.svg")
    assert "r1c2 is smaller than the others" in err
    marked = read_target(tmp_path / "a.yaml").layout
    assert {radius: marked.radius_mm.tolist().count(radius) for radius in (6.0, 8.0)} == {6.0: 1, 8.0: 19}
    assert circles_of(tmp_path / "a.svg")["r1c2"][2] == 6.0
    assert "r1c2 is a mark of radius 6 mm instead of 8 mm" in (tmp_path / "a.yaml").read_text()
    _, _, err = run("print", target(BOARD), "-o", tmp_path / "b.svg", "--no-marks")
    assert "no image tells which way up it is" in err
    assert set(read_target(tmp_path / "b.yaml").layout.radius_mm.tolist()) == {8.0}


def test_a_board_with_marks_of_its_own_keeps_them(run, tmp_path, target):
    text = BOARD.replace("rows: 4", "rows: 3") + "marks: [{at: [1, 2], radius_mm: 5}]\n"
    _, _, err = run("print", target(text), "-o", tmp_path / "a.svg")
    assert "its own marks do not settle it" in err
    assert read_target(tmp_path / "a.yaml").layout == read_target(target(text)).layout


@pytest.mark.parametrize(
    ("polarity", "option", "written"),
    [
        ("any", None, "dark"),
        ("dark", None, "dark"),
        ("bright", None, "bright"),
        ("bright", "--dark-on-light", "dark"),
        ("any", "--light-on-dark", "bright"),
    ],
)
def test_polarity_is_that_of_the_sheet(run, tmp_path, target, polarity, option, written):
    options = [] if option is None else [option]
    run("print", target(f"{DISC}polarity: {polarity}\n"), "-o", tmp_path / "a.svg", *options)
    assert read_target(tmp_path / "a.yaml").polarity == written
    fill = re.search(r'r="60" fill="(\S+)"', (tmp_path / "a.svg").read_text()).group(1)
    assert fill == ("#000" if written == "dark" else "#fff")


def test_copies_draws_several(run, tmp_path, target):
    run("print", target(f"{DISC}count: all\n"), "-o", tmp_path / "a.svg", "--copies", 4)
    assert len(circles_of(tmp_path / "a.svg")) == 4
    assert read_target(tmp_path / "a.yaml").count == 4
    _, _, err = run("print", target(f"{DISC}count: all\n"), "-o", tmp_path / "b.svg")
    assert "count: all says no number, so the sheet has 1" in err
    assert read_target(tmp_path / "b.yaml").count is None


def test_tiles_are_files_of_svg_and_pages_of_pdf(run, tmp_path, target):
    pytest.importorskip("reportlab")
    pypdfium2 = pytest.importorskip("pypdfium2")
    text = BOARD.replace("rows: 4", "rows: 12")
    _, out, err = run("print", target(text), "-o", tmp_path / "a.svg", "--paper", "A4")
    assert [line.rpartition("/")[2] for line in out.splitlines()] == ["a-1.svg", "a-2.svg", "a.yaml"]
    assert "Print the 2 sheets at 100 %" in err
    assert not (tmp_path / "a.svg").exists()
    _, out, _ = run("print", target(text), "-o", tmp_path / "b.pdf", "--paper", "A4")
    assert [line.rpartition("/")[2] for line in out.splitlines()] == ["b.pdf", "b.yaml"]
    assert len(pypdfium2.PdfDocument(tmp_path / "b.pdf")) == 2


@pytest.mark.skipif(not code.has_segno(), reason="needs segno, of the extra print")
@pytest.mark.parametrize("text", [DISC, RING, BOARD])
def test_the_code_is_the_target(run, tmp_path, target, text):
    pytest.importorskip("resvg_py")
    run("print", target(text), "-o", tmp_path / "a.svg")
    pixels = svg_pixels((tmp_path / "a.svg").read_bytes(), 12.0)
    # OpenCV's first detector takes the corner alone, as one holds a telephone.
    corner = cv2.copyMakeBorder(pixels[-540:, :600], 20, 20, 20, 20, cv2.BORDER_CONSTANT, value=255)
    for detector, image in ((cv2.QRCodeDetector(), corner), (cv2.QRCodeDetectorAruco(), pixels)):
        read, _, _ = detector.detectAndDecode(image)
        again = target_from_mapping(parse_yaml(read, "code", TargetError, ""), "code")
        assert again == read_target(tmp_path / "a.yaml")


@pytest.mark.skipif(not code.has_segno(), reason="needs segno, of the extra print")
def test_a_target_too_long_for_a_code_has_none(run, tmp_path, target):
    more = "".join(f"- {{name: h{i}, x_mm: {30 * i}, y_mm: 100, radius_mm: {5 + i}}}\n" for i in range(6))
    code_, _, err = run("print", target(LIST + more), "-o", tmp_path / "a.svg")
    assert code_ == 0
    assert re.search(r"no QR code: the target has \d+ bytes, and a code that is read well holds 412", err)


def test_without_segno_the_sheet_has_no_code(run, tmp_path, target, monkeypatch):
    monkeypatch.setattr(code, "find_spec", lambda _: None)
    code_, _, err = run("print", target(DISC), "-o", tmp_path / "a.svg")
    assert code_ == 0
    assert "no QR code: it needs segno; run: pip install 'circlepose[print]'" in err
    assert (tmp_path / "a.svg").exists()
    _, _, err = run("print", target(DISC), "-o", tmp_path / "a.svg", "--no-qr")
    assert "QR" not in err


@pytest.mark.parametrize(("module", "form", "package"), [(pdf, "pdf", "reportlab"), (dxf, "dxf", "ezdxf")])
def test_a_missing_package_is_named(run, tmp_path, target, monkeypatch, module, form, package):
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    code_, out, err = run("print", target(DISC), "-o", tmp_path / f"a.{form}")
    assert (code_, out) == (2, "")
    assert f"{form.upper()} needs {package}, which is not installed; run: pip install 'circlepose[print]'" in err
    assert list(tmp_path.iterdir()) == [tmp_path / "target.yaml"]


@pytest.mark.parametrize(
    ("text", "args", "said"),
    [
        (DISC, ["-o", "a.png"], "a.png: expected a name that ends in .svg, .pdf or .dxf."),
        (DISC, ["-o", "a"], "a: expected a name that ends in"),
        (DISC, ["-o", "gone/a.svg"], "the folder gone does not exist; make it first."),
        (DISC, ["-o", "a.svg", "--paper", "A9"], "--paper: expected A5, A4"),
        (DISC, ["-o", "a.svg", "--paper", "100x100"], "too small for circle disc of radius 60 mm"),
        ("radius_mm: 0\n", ["-o", "a.svg"], "radius_mm: expected a positive radius in mm"),
        (
            BOARD.replace("radius_mm: 8", "radius_mm: 16"),
            ["-o", "a.svg"],
            "overlap: their centers are 30 mm apart, their radii 16 and 16 mm",
        ),
        (BOARD, ["-o", "a.svg", "--copies", "2"], "--copies: is of discs and rings"),
        ("kind: coaxial\nradii_mm: [45, 30]\n", ["-o", "a.svg"], "a sheet is flat; print kind: coplanar"),
        (LIST + "- {name: pin, x_mm: 50, y_mm: 40, z_mm: 9, radius_mm: 5}\n", ["-o", "a.svg"], "pin lies 9 mm off"),
    ],
)
def test_what_cannot_be_printed_is_one_sentence(run, tmp_path, target, monkeypatch, text, args, said):
    monkeypatch.chdir(tmp_path)
    code_, out, err = run("print", target(text), *args)
    assert (code_, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == [tmp_path / "target.yaml"]


def test_a_dxf_has_no_tiles(run, tmp_path, target):
    pytest.importorskip("ezdxf")
    text = BOARD.replace("rows: 4", "rows: 12")
    code_, _, err = run("print", target(text), "-o", tmp_path / "a.dxf", "--paper", "A4")
    assert code_ == 2
    assert "a DXF is one drawing, which takes 2 sheets of this paper; leave --paper out." in err


def test_the_target_that_is_read_is_never_written(run, tmp_path, target):
    path = target(DISC, "sheet.yaml")
    for more in ([], ["--overwrite"]):
        code_, _, err = run("print", path, "-o", tmp_path / "sheet.svg", *more)
        assert code_ == 2
        assert "would be overwritten, but it holds the target" in err
    assert path.read_text() == DISC
    assert not (tmp_path / "sheet.svg").exists()
    link = tmp_path / "other.yaml"
    link.symlink_to(path)
    assert run("print", path, "-o", tmp_path / "other.svg")[0] == 2


@pytest.mark.parametrize("name", ["sheet.svg", "sheet.yaml"])
def test_files_of_others_are_kept_and_nothing_is_written_beside_them(run, tmp_path, target, name):
    (tmp_path / name).write_text("mine")
    code_, _, err = run("print", target(DISC), "-o", tmp_path / "sheet.svg")
    assert code_ == 2
    assert "does not bear circlepose's mark" in err
    assert {path.name for path in tmp_path.iterdir()} == {"target.yaml", name}
    assert run("print", target(DISC), "-o", tmp_path / "sheet.svg", "--overwrite")[0] == 0


@pytest.mark.parametrize("name", ["sheet.svg", "sheet.yaml"])
def test_a_folder_in_the_way_is_named(run, tmp_path, target, name):
    (tmp_path / name).mkdir()
    code_, _, err = run("print", target(DISC), "-o", tmp_path / "sheet.svg")
    assert code_ == 2
    assert f"{name}: is a folder; give the name of a file." in err


def test_a_scale_that_was_measured_is_not_lost(run, tmp_path, target):
    run("print", target(DISC), "-o", tmp_path / "sheet.svg")
    beside = tmp_path / "sheet.yaml"
    beside.write_text(beside.read_text().replace("# print_scale: {x: 1.000, y: 1.000}", "print_scale: 1.0031"))
    assert read_target(beside).radii_mm[0] == pytest.approx(60.0 * 1.0031)
    code_, _, err = run("print", target(DISC), "-o", tmp_path / "sheet.svg")
    assert code_ == 2
    assert "sheet.yaml: holds the print_scale of a sheet that was measured" in err
    assert "1.0031" in beside.read_text()
    assert run("print", target(DISC), "-o", tmp_path / "sheet.svg", "--overwrite")[0] == 0
    assert read_target(beside).radii_mm[0] == 60.0


def test_a_measured_target_is_drawn_the_other_way_about(run, tmp_path, target):
    path = target(f"{DISC}print_scale: {{x: 1.02, y: 0.99}}\n")
    code_, _, err = run("print", path, "-o", tmp_path / "sheet.svg")
    assert code_ == 0
    assert "print_scale: drawn 0.980392 in x and 1.0101 in y times as long" in err
    assert 'transform="scale(0.980392157 1.01010101)"' in (tmp_path / "sheet.svg").read_text()
    assert read_target(tmp_path / "sheet.yaml").radii_mm == (60.0,)


def test_the_target_beside_a_sheet_has_its_side_and_its_circles(run, tmp_path, target):
    (tmp_path / "plate.csv").write_text("name,x_mm,y_mm,radius_mm\na,0,0,9\nb,50,10,9\nc,10,60,7\n")
    run("print", target("kind: board\ncircles: plate.csv\n"), "-o", tmp_path / "sheet.svg")
    printed = read_target(tmp_path / "sheet.yaml")
    assert printed.layout.side == "front"
    assert printed.layout.names == ("a", "b", "c")
    assert "plate.csv" not in (tmp_path / "sheet.yaml").read_text()


def test_quiet_says_nothing(run, tmp_path, target):
    _, _, err = run("print", target(BOARD), "-o", tmp_path / "sheet.svg", "-q")
    assert err == ""


@pytest.mark.parametrize("form", ["svg", "pdf", "dxf"])
def test_odd_names_do_no_harm(run, tmp_path, target, form):
    pytest.importorskip("reportlab")
    pytest.importorskip("ezdxf")
    text = LIST.replace("name: a", 'name: "\\a <&> ö"')
    code_, _, err = run("print", target(text, "größe\udce4 <b>&.yaml"), "-o", tmp_path / f"sheet.{form}")
    assert code_ == 0, err
    assert read_target(tmp_path / "sheet.yaml").layout.names[0] == "\a <&> ö"
    if form == "svg":
        ElementTree.parse(tmp_path / "sheet.svg")


def test_a_board_is_suggested_for_a_camera_and_a_paper(run, tmp_path):
    camera = tmp_path / "cam.yaml"
    camera.write_text("camera_matrix: [[500, 0, 159.5], [0, 500, 119.5], [0, 0, 1]]\nimage_size: [320, 240]\n")
    sheet = tmp_path / "board.svg"
    asked = ("print", "--suggest", "--paper", "A5", "--calib", camera, "--distance-mm", "300:500")
    code, out, err = run(*asked, "-o", sheet)
    assert code == 0, err
    assert out.splitlines() == [str(sheet), str(tmp_path / "board.yaml")]
    assert "circles of radius" in err
    assert "boards that fit" in err
    target = read_target(tmp_path / "board.yaml")
    assert target.kind == "board"
    assert len(target.layout) >= 4


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--suggest"], "--suggest: needs --calib FILE, --distance-mm A:B and --paper SIZE."),
        ([], "TARGET.yaml: is missing; give the target file to print, or --suggest."),
        (["t.yaml", "--suggest"], "TARGET.yaml, --suggest: give one of them."),
        (["t.yaml", "--distance-mm", "3"], "--calib, --distance-mm: go with --suggest;"),
        (
            ["--suggest", "--calib", "c.yaml", "--distance-mm", "0", "--paper", "A4"],
            "--distance-mm: expected distances",
        ),
    ],
)
def test_what_goes_with_a_suggestion(run, tmp_path, args, message):
    code, out, err = run("print", *args, "-o", tmp_path / "s.svg")
    assert (code, out) == (2, "")
    assert message in err
