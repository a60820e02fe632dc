"""Images without circles, from fixed seeds: text, polygons, markers; photographed at 640 x 480, gray.

Text has no i, j and points: these are round in many fonts. Many letters have a ring or a bow that is an ellipse as
far as their pixels show (o, O, 0, Q; the bows of b, d, p, q, a, e, g, 6, 8, 9); text without them is a kind of its
own. Fonts are those that come with Matplotlib.
"""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from benchmarks.support.empty_grounds import SIZE, finished, photograph
from circlepose._typing import FloatArray, Image

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

SHEET = (2 * SIZE[0], 2 * SIZE[1])
"""px of a sheet that is drawn for `photograph`"""
SHEET_SCALE = 1.25
"""px of the sheet to a px of its photograph, about"""
WORDS = (
    "the of and to a that was for on are as they at be from or one had by word but not what all were we "
    "when your can use an each how up out them then so some her would make has look two more go see "
    "number no way could people my than water been call who down day get come made may part over new "
    "sound take only know place year back most very after our name good man help through much before too "
    "same"
)
PLAIN_WORDS = (
    "fly sky why try my hymn must turn trust rust hunt hull full null runs sun fun us thus truth lynx sunny hurry "
    "rusty funny hut nut knurl zulu furry tusk sulky lusty myth ruts vuny xylf kurtz"
)
"""letters without a ring or a bow that closes nearly: no a, b, c, d, e, g, o, p, q"""
FONTS = (
    "DejaVuSans",
    "DejaVuSans-Bold",
    "DejaVuSerif",
    "DejaVuSansMono",
    "STIXGeneral",
    "cmr10",
    "DejaVuSans-Oblique",
)
HERSHEY = (
    cv2.FONT_HERSHEY_SIMPLEX,
    cv2.FONT_HERSHEY_PLAIN,
    cv2.FONT_HERSHEY_DUPLEX,
    cv2.FONT_HERSHEY_COMPLEX,
    cv2.FONT_HERSHEY_TRIPLEX,
)
DICTIONARIES = (
    *(f"DICT_{side}X{side}_{number}" for side in (4, 5, 6, 7) for number in (50, 100, 250, 1000)),
    "DICT_ARUCO_ORIGINAL",
    "DICT_ARUCO_MIP_36H12",
    *(f"DICT_APRILTAG_{name}" for name in ("16H5", "25H9", "36H10", "36H11")),
)


def line_of_text(generator: np.random.Generator, letters: int, *, has_rings: bool = True) -> str:
    """Return words, numbers and capitals, perhaps without letters that have a ring."""
    words: list[str] = []
    while sum(len(word) + 1 for word in words) < letters:
        word = str(generator.choice((WORDS if has_rings else PLAIN_WORDS).split()))
        kind = generator.random()
        if kind < 0.15:
            word = word.capitalize()
        elif kind < 0.22:
            word = word.upper()
        elif kind < 0.28:
            digits = generator.choice(
                list("0123456789" if has_rings else "123457"), size=int(generator.integers(1, 5))
            )
            word = "".join(digits)
        words.append(word)
    # A capital R and P have bows.
    return " ".join(words) if has_rings else " ".join(words).replace("R", "T")


def page(generator: np.random.Generator, has_rings: bool, scale: float = SHEET_SCALE) -> Image:
    """Return a sheet with lines of a printed font, 8 to 40 px high once photographed."""
    from PIL import Image as Pillow  # noqa: PLC0415 - comes with Matplotlib, of an extra
    from PIL import ImageDraw  # noqa: PLC0415

    height = scale * np.exp(generator.uniform(np.log(8.0), np.log(40.0)))
    font = _font(str(generator.choice(FONTS)), round(height / 0.73))
    sheet = Pillow.new("L", SHEET, 240)
    draw = ImageDraw.Draw(sheet)
    line = partial(line_of_text, has_rings=has_rings)
    for y in np.arange(0.5 * height, SHEET[1], 2.0 * height):
        draw.text((0.5 * height, float(y)), line(generator, int(2.2 * SHEET[0] / height)), fill=25, font=font)
    return np.asarray(sheet)


def text(generator: np.random.Generator, has_rings: bool = True) -> Image:
    """A page, photographed from the side."""
    return photograph(page(generator, has_rings), generator)


def scanned_text(generator: np.random.Generator, has_rings: bool = True) -> Image:
    """A page, straight."""
    return photograph(page(generator, has_rings, 2.0), generator, warp=0.0)


def drawn_text(generator: np.random.Generator, has_rings: bool = True) -> Image:
    """Lines of OpenCV's stroke fonts."""
    height = SHEET_SCALE * np.exp(generator.uniform(np.log(8.0), np.log(40.0)))
    sheet = np.full(SHEET[::-1], 235, np.uint8)
    font = HERSHEY[int(generator.integers(len(HERSHEY)))]
    thickness = max(1, round(height / generator.uniform(5.0, 12.0)))
    scale = cv2.getFontScaleFromHeight(font, int(height), thickness)
    for y in np.arange(1.5 * height, SHEET[1], 2.0 * height):
        line = line_of_text(generator, int(1.6 * SHEET[0] / height), has_rings=has_rings)
        cv2.putText(sheet, line, (int(height), int(y)), font, scale, 30, thickness, cv2.LINE_AA)
    return photograph(sheet, generator)


def regular(generator: np.random.Generator, lowest: int, highest: int) -> Image:
    """Six regular polygons with this many corners, of 8 to 60 px, in affine views."""
    number = int(generator.integers(lowest, highest + 1))
    turn = 2.0 * np.pi * np.arange(number) / number
    return _shapes(generator, [np.column_stack([np.cos(turn), np.sin(turn)])] * 6)


def irregular(generator: np.random.Generator) -> Image:
    """Six polygons of unequal sides."""
    shapes = []
    for _ in range(6):
        number = int(generator.integers(4, 12))
        turn = 2.0 * np.pi * (np.arange(number) + generator.uniform(-0.35, 0.35, number)) / number
        radius = generator.uniform(0.6, 1.0, number)
        shapes.append(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]))
    return _shapes(generator, shapes)


def markers(generator: np.random.Generator) -> Image:
    """Markers of one of OpenCV's dictionaries, cells of 2 to 20 px."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, str(generator.choice(DICTIONARIES))))
    cells = dictionary.markerSize + 2
    side = cells * _module_px(generator)
    sheet = np.full(SHEET[::-1], 240, np.uint8)
    step = side + max(8, side // 3)
    for y in range(step // 4, SHEET[1] - side, step):
        for x in range(step // 4, SHEET[0] - side, step):
            number = int(generator.integers(len(dictionary.bytesList)))
            sheet[y : y + side, x : x + side] = cv2.aruco.generateImageMarker(dictionary, number, side)
    return photograph(sheet, generator)


def qr_codes(generator: np.random.Generator) -> Image:
    """QR codes of text, cells of 2 to 20 px."""
    encoder = cv2.QRCodeEncoder.create()
    module = _module_px(generator)
    codes = [encoder.encode(line_of_text(generator, int(generator.integers(8, 60)))) for _ in range(4)]
    sheet = np.full(SHEET[::-1], 240, np.uint8)
    y = 4
    while y < SHEET[1] - 25 * module:
        x, tallest = 4, 0
        while x < SHEET[0] - 25 * module:
            code = codes[int(generator.integers(len(codes)))].repeat(module, axis=0).repeat(module, axis=1)
            window = sheet[y : y + code.shape[0], x : x + code.shape[1]]
            window[:] = code[: window.shape[0], : window.shape[1]]
            x, tallest = x + code.shape[1] + 4 * module, max(tallest, code.shape[0])
        y += tallest + 4 * module
    return photograph(sheet, generator)


def cells(generator: np.random.Generator) -> Image:
    """Random cells of 2 to 20 px, as of coded boards."""
    module = _module_px(generator)
    columns, rows = -(-SHEET[0] // module), -(-SHEET[1] // module)
    dark = generator.random((rows, columns)) < generator.uniform(0.15, 0.6)
    sheet = np.where(dark, 25, 235).astype(np.uint8).repeat(module, axis=0).repeat(module, axis=1)
    return photograph(sheet[: SHEET[1], : SHEET[0]], generator)


def _module_px(generator: np.random.Generator) -> int:
    return max(3, round(SHEET_SCALE * np.exp(generator.uniform(np.log(2.0), np.log(20.0)))))


@lru_cache
def _font(name: str, size: int) -> FreeTypeFont:
    import matplotlib as mpl  # noqa: PLC0415
    from PIL import ImageFont  # noqa: PLC0415

    return ImageFont.truetype(str(Path(mpl.get_data_path()) / "fonts" / "ttf" / f"{name}.ttf"), size)


def _shapes(generator: np.random.Generator, shapes: list[FloatArray]) -> Image:
    """Return shapes of unit size, each 8 to 60 px and in an affine view, in a row of three above another."""
    dark = generator.random() < 0.5
    ground, level = (210, 50) if dark else (60, 200)
    sheet = np.full((4 * SIZE[1], 4 * SIZE[0]), ground, np.uint8)
    for place, shape in enumerate(shapes):
        radius = np.exp(generator.uniform(np.log(8.0), np.log(60.0)))
        turn, lean = generator.uniform(0.0, 2.0 * np.pi, 2)
        squeeze = np.diag([1.0, np.cos(np.radians(generator.uniform(0.0, 55.0)))])
        view = _turn(turn) @ squeeze @ _turn(lean)
        at = (np.array([place % 3, place // 3]) + 0.5) * [SIZE[0] / 3.0, SIZE[1] / 2.0]
        outline = 4.0 * (radius * shape @ view + at + generator.uniform(-15.0, 15.0, 2))
        cv2.fillPoly(sheet, [np.rint(16.0 * outline).astype(np.int32)], level, cv2.LINE_AA, 4)
    return finished(cv2.resize(sheet, SIZE, interpolation=cv2.INTER_AREA).astype(np.float64), generator)


def _turn(angle: float) -> FloatArray:
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
