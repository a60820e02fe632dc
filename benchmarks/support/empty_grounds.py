"""Images without circles, from fixed seeds: noise, textures, blobs without an edge, gradients. 640 x 480, gray."""

from __future__ import annotations

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image

SIZE = (640, 480)


def eight_bit(levels: FloatArray) -> Image:
    """Return gray levels as pixels."""
    return np.clip(np.rint(levels), 0.0, 255.0).astype(np.uint8)


def as_jpeg(image: Image, quality: int) -> Image:
    """Return what JPEG leaves of an image."""
    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return cv2.imdecode(coded, cv2.IMREAD_UNCHANGED)


def photograph(sheet: Image, generator: np.random.Generator, warp: float = 0.25) -> Image:
    """Return the photograph of a sheet that is drawn at twice the size: warped, shaded, blurred, noisy, often JPEG.

    `warp` is by how much of the image's size the corners move, at most.
    """
    width, height = SIZE
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    # The sheet goes beyond the image's corners.
    seen = corners * 1.6 - 0.3 + generator.uniform(-warp, warp, (4, 2)) * 0.8
    turn = generator.uniform(-0.5, 0.5) if warp > 0.0 else 0.0
    turned = (seen - 0.5) @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + 0.5
    if warp == 0.0:
        turned = corners
    source = (corners * [sheet.shape[1] - 1, sheet.shape[0] - 1]).astype(np.float32)
    target = (turned * [2 * width, 2 * height]).astype(np.float32)
    large = cv2.warpPerspective(
        sheet,
        cv2.getPerspectiveTransform(source, target),
        (2 * width, 2 * height),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(int(generator.integers(60, 250)),),
    )
    levels = cv2.resize(large, SIZE, interpolation=cv2.INTER_AREA).astype(np.float64)
    low, gain = generator.uniform(5.0, 60.0), generator.uniform(0.5, 0.8)
    return finished(low + gain * levels, generator)


def finished(levels: FloatArray, generator: np.random.Generator) -> Image:
    """Return pixels of a camera: light that falls off, blur 0.4 to 1.5 px, noise 1 to 5, every other one a JPEG."""
    height, width = levels.shape
    across, along = np.meshgrid(np.linspace(-0.5, 0.5, width), np.linspace(-0.5, 0.5, height))
    light = 1.0 + generator.uniform(-0.3, 0.3) * across + generator.uniform(-0.3, 0.3) * along
    seen = cv2.GaussianBlur(levels * light, (0, 0), generator.uniform(0.4, 1.5))
    image = eight_bit(seen + generator.uniform(1.0, 5.0) * generator.standard_normal(levels.shape))
    return as_jpeg(image, int(generator.integers(70, 96))) if generator.random() < 0.5 else image


def white(generator: np.random.Generator) -> Image:
    sigma = np.exp(generator.uniform(np.log(2.0), np.log(60.0)))
    return eight_bit(120.0 + sigma * generator.standard_normal(SIZE[::-1]))


def pink(generator: np.random.Generator) -> Image:
    return eight_bit(120.0 + generator.uniform(10.0, 50.0) * fractal(generator, 1.0))


def noise_jpeg(generator: np.random.Generator) -> Image:
    levels = generator.standard_normal(SIZE[::-1])
    levels = cv2.GaussianBlur(levels, (0, 0), generator.uniform(0.3, 3.0))
    return as_jpeg(
        eight_bit(120.0 + generator.uniform(5.0, 40.0) * levels / levels.std()), int(generator.integers(15, 70))
    )


def faint_noise_jpeg(generator: np.random.Generator) -> Image:
    """Return noise of which compression leaves smooth blobs of a few levels."""
    levels = generator.uniform(60.0, 200.0) + generator.uniform(0.5, 4.0) * generator.standard_normal(SIZE[::-1])
    return as_jpeg(eight_bit(levels), int(generator.integers(50, 86)))


def salt_and_pepper(generator: np.random.Generator) -> Image:
    levels = 120.0 + 2.0 * generator.standard_normal(SIZE[::-1])
    chance = generator.random(levels.shape)
    share = generator.uniform(0.005, 0.1)
    levels[chance < share] = 0.0
    levels[chance > 1.0 - share] = 255.0
    return eight_bit(levels)


def fractal(generator: np.random.Generator, power: float) -> FloatArray:
    """Return noise (h, w) whose amplitude falls as frequency to this power, of standard deviation 1."""
    height, width = SIZE[::-1]
    waves = np.fft.rfft2(generator.standard_normal((height, width)))
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width))
    frequency[0, 0] = 1.0
    levels = np.fft.irfft2(waves / frequency**power, (height, width))
    return (levels - levels.mean()) / levels.std()


def stripes(generator: np.random.Generator) -> Image:
    sheet = np.full((2 * SIZE[1], 2 * SIZE[0]), 230, np.uint8)
    width = int(generator.integers(4, 50))
    for x in range(0, 2 * SIZE[0], 2 * width):
        sheet[:, x : x + width] = 30
    return photograph(sheet, generator)


def chessboard(generator: np.random.Generator) -> Image:
    side = int(generator.integers(10, 100))
    y, x = np.mgrid[0 : 2 * SIZE[1], 0 : 2 * SIZE[0]]
    return photograph(np.where((x // side + y // side) % 2 == 0, 230, 30).astype(np.uint8), generator)


def voronoi(generator: np.random.Generator) -> Image:
    """Cells around random points; every other image has walls between them, as dried mud."""
    number = int(np.exp(generator.uniform(np.log(30), np.log(1500))))
    away = np.full((2 * SIZE[1], 2 * SIZE[0]), 255, np.uint8)
    away[generator.integers(2 * SIZE[1], size=number), generator.integers(2 * SIZE[0], size=number)] = 0
    _, cells = cv2.distanceTransformWithLabels(away, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    levels = generator.uniform(40.0, 220.0, number + 1)[cells]
    if generator.random() < 0.5:
        walls = cv2.dilate(cells.astype(np.float32), np.ones((3, 3))) > cv2.erode(cells.astype(np.float32), None)
        levels = np.where(cv2.dilate(walls.astype(np.uint8), None) > 0, 20.0, 0.5 * (levels + 130.0))
    return finished(cv2.resize(levels, SIZE, interpolation=cv2.INTER_AREA), generator)


def leaves(generator: np.random.Generator, size: tuple[int, int] = SIZE) -> Image:
    """Leaves over one another: pointed, bent, with a vein."""
    sheet = np.full((2 * size[1], 2 * size[0]), 60, np.uint8)
    typical = generator.uniform(20.0, 80.0)
    for _ in range(int(2.5 * 4.0 * size[0] * size[1] / typical**2)):
        length = typical * np.exp(generator.normal(0.0, 0.3))
        along = np.linspace(0.0, 1.0, 24)
        half = generator.uniform(0.12, 0.3) * np.sin(np.pi * along ** generator.uniform(0.7, 1.0)) ** 1.3
        bend = generator.uniform(-0.2, 0.2) * along**2
        upper, lower = np.column_stack([along, bend + half]), np.column_stack([along, bend - half])
        turn = generator.uniform(0.0, 2.0 * np.pi)
        spin = 2.0 * length * np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        at = generator.uniform(-0.05, 1.05, 2) * [2 * size[0], 2 * size[1]]
        outline = np.vstack([upper, lower[::-1]]) @ spin + at
        level = float(generator.uniform(40.0, 210.0))
        cv2.fillPoly(sheet, [np.rint(16.0 * outline).astype(np.int32)], level, cv2.LINE_AA, 4)
        vein = np.column_stack([along, bend]) @ spin + at
        cv2.polylines(sheet, [np.rint(16.0 * vein).astype(np.int32)], False, level + 25.0, 1, cv2.LINE_AA, 4)
    return finished(cv2.resize(sheet, size, interpolation=cv2.INTER_AREA).astype(np.float64), generator)


def brick(generator: np.random.Generator) -> Image:
    height = int(generator.integers(24, 90))
    sheet = np.full((2 * SIZE[1], 2 * SIZE[0]), 200, np.uint8)
    joint = max(2, height // 8)
    for row, y in enumerate(range(0, sheet.shape[0], height)):
        for x in range(-height * (row % 2), sheet.shape[1], int(2.2 * height)):
            level = int(generator.integers(70, 140))
            sheet[y : y + height - joint, max(x, 0) : max(x + int(2.2 * height) - joint, 0)] = level
    grain = cv2.resize(fractal(generator, 0.7), (sheet.shape[1], sheet.shape[0]))
    return photograph(eight_bit(sheet + 8.0 * grain), generator)


def wood(generator: np.random.Generator) -> Image:
    """Boards with a grain of long wavy lines, without knots."""
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]].astype(np.float64)
    wave = cv2.GaussianBlur(fractal(generator, 1.5), (0, 0), 10.0)
    period = generator.uniform(5.0, 25.0)
    lines = np.sin(2.0 * np.pi * (y + 0.05 * x) / period + 3.0 * wave)
    fibers = cv2.GaussianBlur(generator.standard_normal(SIZE[::-1]), (0, 0), 12.0, sigmaY=0.6)
    levels = 130.0 + 25.0 * lines + 15.0 * fibers / fibers.std()
    board = int(generator.integers(80, 200))
    for edge in range(board, SIZE[1], board):
        levels[edge : edge + 2] = 30.0
    return finished(levels, generator)


def fabric(generator: np.random.Generator) -> Image:
    """A weave seen from near: threads over and under."""
    y, x = np.mgrid[0 : 2 * SIZE[1], 0 : 2 * SIZE[0]].astype(np.float64)
    thread = generator.uniform(6.0, 40.0)
    column, row = np.floor(x / thread), np.floor(y / thread)
    across, along = x / thread - column - 0.5, y / thread - row - 0.5
    warp_above = (column + row) % 2 == 0
    height = np.where(
        warp_above,
        np.sqrt(np.maximum(0.3 - across**2, 0.0)) * (1.0 - along**2),
        np.sqrt(np.maximum(0.3 - along**2, 0.0)) * (1.0 - across**2),
    )
    levels = 40.0 + 300.0 * height + np.where(warp_above, generator.uniform(-30.0, 30.0), 0.0)
    return photograph(eight_bit(levels + 8.0 * generator.standard_normal(levels.shape)), generator)


def blob(generator: np.random.Generator) -> Image:
    """One Gaussian blob."""
    return _blobs(generator, 1)


def blobs(generator: np.random.Generator) -> Image:
    """Several Gaussian blobs."""
    return _blobs(generator, int(generator.integers(3, 15)))


def clouds(generator: np.random.Generator) -> Image:
    """Smooth noise of one scale: hills and hollows without an edge."""
    hills = cv2.GaussianBlur(generator.standard_normal(SIZE[::-1]), (0, 0), generator.uniform(5.0, 30.0))
    levels = 120.0 + generator.uniform(15.0, 45.0) * hills / hills.std()
    return eight_bit(levels + generator.uniform(0.5, 3.0) * generator.standard_normal(levels.shape))


def gradient(generator: np.random.Generator) -> Image:
    """A plane of light, or a lens's fall-off, with noise that leaves no steps."""
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]].astype(np.float64)
    turn = generator.uniform(0.0, 2.0 * np.pi)
    levels = 128.0 + generator.uniform(20.0, 120.0) * (
        np.cos(turn) * (x / 640.0 - 0.5) + np.sin(turn) * (y / 480.0 - 0.5)
    )
    if generator.random() < 0.5:
        away = np.hypot(x - generator.uniform(200.0, 440.0), y - generator.uniform(150.0, 330.0)) / 500.0
        levels *= 1.0 / (1.0 + away**2) ** 2
    return eight_bit(levels + generator.uniform(0.7, 4.0) * generator.standard_normal(levels.shape))


def _blobs(generator: np.random.Generator, number: int) -> Image:
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]].astype(np.float64)
    ground, sign = (40.0, 1.0) if generator.random() < 0.5 else (210.0, -1.0)
    levels = np.full(SIZE[::-1], ground)
    for _ in range(number):
        sigma = np.exp(generator.uniform(np.log(3.0), np.log(40.0)))
        ratio, turn = generator.uniform(0.5, 1.0), generator.uniform(0.0, np.pi)
        dx, dy = x - generator.uniform(60.0, 580.0), y - generator.uniform(60.0, 420.0)
        u, v = (
            (np.cos(turn) * dx + np.sin(turn) * dy) / sigma,
            (np.cos(turn) * dy - np.sin(turn) * dx) / (ratio * sigma),
        )
        levels += sign * generator.uniform(30.0, 160.0) * np.exp(-0.5 * (u**2 + v**2))
    # The sum stays within the range: a clipped blob has an edge.
    span = np.abs(levels - ground).max()
    levels = ground + (levels - ground) * min(1.0, 165.0 / span)
    return eight_bit(levels + generator.uniform(0.0, 3.0) * generator.standard_normal(levels.shape))
