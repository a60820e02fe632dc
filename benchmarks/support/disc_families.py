"""The families of rendered images on which recall is measured; each yields its images from fixed seeds.

Contrasts are in gray levels of 255 unless said, about a mean level of 120; radius and blur in px.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator

import cv2
import numpy as np

from benchmarks.support.disc_pictures import (
    LENS_PX,
    RADIUS_MM,
    Board,
    Picture,
    board,
    hiding,
    photographed,
    rendered,
    rough_patch,
    stripes,
)
from circlepose._typing import FloatArray, Image
from circlepose.synthesis.scene import Box, Paint, Patch, Scene, Texture

MEAN = 120.0
RADII = (4.0, 6.0, 10.0, 20.0, 40.0, 80.0)
CONTRAST_TO_NOISE = (1.5, 2.5, 4.0, 8.0, 30.0)
BLURS = (0.7, 2.0, 4.0, 8.0, 14.0)
HIDDEN = (0.25, 0.4)


def generator_of(*key: object) -> np.random.Generator:
    """Return the random numbers of an image, by what it is called."""
    return np.random.Generator(np.random.PCG64(zlib.crc32(repr(key).encode())))


def scene_picture(setting: str, contrast: float, noise: float, radius: float, blur: float, hidden: float) -> Picture:
    """Return twelve discs on an even ground, dark ones where the contrast is negative."""
    generator = generator_of(setting, contrast, noise, radius, blur, hidden)
    where = board(generator, radius, 8.0 + 2.5 * blur)
    disc_level, ground = MEAN + contrast / 2.0, MEAN - contrast / 2.0
    discs = where.discs(disc_level)
    occluders: list[Patch] = []
    for number, disc in enumerate(discs if hidden > 0.0 else ()):
        level = ground + contrast * (0.5, -0.6)[int(generator.integers(2))]
        occluders += hiding(disc, hidden, 1 + number % 2, level, generator)
    scene = Scene(where.camera, discs, Paint(ground), occluders=tuple(occluders))
    return Picture(setting, photographed(rendered(scene, blur), noise, generator), where.camera, discs)


def noise() -> Iterator[Picture]:
    """Contrast 60, noise by radius."""
    for radius in (*RADII[:4], 30.0, *RADII[4:]):
        for ratio in CONTRAST_TO_NOISE:
            for sign in (1.0, -1.0):
                setting = f"r {radius:g}, contrast/noise {ratio:g}"
                yield scene_picture(setting, sign * 60.0, 60.0 / ratio, radius, LENS_PX, 0.0)


def blur() -> Iterator[Picture]:
    """Contrast 100 at noise 2, blur by radius, up to the radius."""
    for radius in RADII:
        for width in BLURS:
            if width <= radius:
                yield scene_picture(f"r {radius:g}, blur {width:g}", -100.0, 2.0, radius, width, 0.0)


def defocus() -> Iterator[Picture]:
    """Contrast 120 at noise 2 and 5 where the blur is a fifth of the radius or more."""
    for radius in (30.0, 45.0, 60.0):
        for width in (8.0, 12.0, 16.0):
            for sigma in (2.0, 5.0):
                yield scene_picture(
                    f"r {radius:g}, blur {width:g}, noise {sigma:g}", 120.0, sigma, radius, width, 0.0
                )


def blurred_noise() -> Iterator[Picture]:
    """Contrast 60 at radius 40, blur by noise."""
    for width in BLURS[1:]:
        for ratio in CONTRAST_TO_NOISE:
            setting = f"r 40, blur {width:g}, contrast/noise {ratio:g}"
            yield scene_picture(setting, -60.0, 60.0 / ratio, 40.0, width, 0.0)


def hidden() -> Iterator[Picture]:
    """Rims partly hidden, by radius, noise and blur."""
    for share in HIDDEN:
        for radius in RADII[1:]:
            yield scene_picture(f"{share:.0%} hidden, r {radius:g}", -140.0, 2.0, radius, LENS_PX, share)
        for ratio in (4.0, 8.0):
            setting = f"{share:.0%} hidden, r 40, contrast/noise {ratio:g}"
            yield scene_picture(setting, -60.0, 60.0 / ratio, 40.0, LENS_PX, share)
        for width in (2.0, 8.0):
            yield scene_picture(f"{share:.0%} hidden, r 40, blur {width:g}", -140.0, 2.0, 40.0, width, share)


COLORS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "red on green": ((40.0, 0.0, 200.0), (60.0, 120.0, 40.0)),
    "green on red": ((60.0, 120.0, 40.0), (40.0, 0.0, 200.0)),
    "pink on teal": ((170.0, 0.0, 230.0), (150.0, 150.0, 60.0)),
    "red on asphalt": ((70.0, 0.0, 170.0), (100.0, 100.0, 100.0)),
    "blue on gray": ((230.0, 0.0, 90.0), (128.0, 128.0, 128.0)),
    "orange on sky": ((40.0, 0.0, 240.0), (230.0, 160.0, 110.0)),
}
"""BGR of disc and ground; the disc's green is set so that both have the same gray"""


def color() -> Iterator[Picture]:
    """Pairs of colors of the same gray, at noise 3; as JPEG; a shape in the alpha channel alone."""
    for name, (disc, ground) in COLORS.items():
        for radius in (12.0, 40.0):
            setting = f"{name}, r {radius:g}"
            where, share, generator = _share(setting, radius)
            image = _colored(share, isoluminant(disc, ground), ground, generator)
            yield Picture(setting, image, where.camera, where.discs(0.0))
            if radius == 12.0:
                _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 85])
                setting = f"{name}, r 12, JPEG 85"
                yield Picture(setting, cv2.imdecode(coded, cv2.IMREAD_COLOR), where.camera, where.discs(0.0))
    where, share, generator = _share("alpha", 30.0)
    alpha = photographed(255.0 * share, 0.0, generator)
    image = np.dstack([np.full((*alpha.shape, 3), 128, np.uint8), alpha])
    yield Picture("alpha channel alone, r 30", image, where.camera, where.discs(0.0))
    where, share, generator = _share("gray in color", 30.0)
    image = _colored(share, (190.0, 190.0, 190.0), (60.0, 70.0, 80.0), generator)
    yield Picture("gray shows all, r 30", image, where.camera, where.discs(0.0))


def isoluminant(disc: tuple[float, float, float], ground: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the disc's color with the green that gives it the gray of the ground."""
    weights = np.array([0.114, 0.587, 0.299])
    blue, _, red = disc
    green = float(weights @ ground - weights[0] * blue - weights[2] * red) / weights[1]
    return blue, float(np.clip(green, 0.0, 255.0)), red


def sixteen_bit() -> Iterator[Picture]:
    """Contrast 400 counts at noise 20 in 16 bit and floating levels, with what cameras add."""
    for setting in ("plain", "a hot pixel", "a dead pixel", "twenty odd pixels", "a dead row and column"):
        where, counts, _ = _counts(setting)
        yield Picture(setting, spoiled(counts, setting).astype(np.uint16), where.camera, where.discs(0.0))
    for setting in ("a telemetry row", "a hot object in a corner"):
        where, counts, _ = _counts(setting)
        yield Picture(setting, spoiled(counts, setting).astype(np.uint16), where.camera, where.discs(0.0))
    where, counts, _ = _counts("float")
    image = (counts / 65535.0).astype(np.float32)
    yield Picture("floating", image, where.camera, where.discs(0.0))
    image = image.copy()
    image[20, 30] = 80.0
    yield Picture("floating, a hot pixel", image, where.camera, where.discs(0.0))


def spoiled(counts: FloatArray, how: str) -> FloatArray:
    """Return 16 bit counts with what the setting names."""
    image = counts.copy()
    height, width = image.shape
    generator = generator_of("spoiled", how)
    if how == "a hot pixel":
        image[height // 2 + 3, width // 3] = 65535.0
    elif how == "a dead pixel":
        image[height // 2 + 3, width // 3] = 0.0
    elif how == "twenty odd pixels":
        at = generator.integers(height, size=20), generator.integers(width, size=20)
        image[at] = generator.choice([0.0, 65535.0], size=20)
    elif how == "a dead row and column":
        image[height // 2 + 9] = 0.0
        image[:, width // 3 + 5] = 0.0
    elif how == "a telemetry row":
        image[:2] = generator.integers(0, 65535, size=(2, width))
    elif how == "a hot object in a corner":
        image[: height // 8, : width // 8] = 60000.0
    return image


def backgrounds() -> Iterator[Picture]:
    """Stripes of 6 mm behind the discs, grounds of two levels, mottle; noise 2."""
    for radius in (20.0, 50.0):
        for name, level in (("disc of 190", 190.0), ("disc of 105, polarity changes", 105.0)):
            setting = f"6 mm stripes of 60 and 150, {name}, r {radius:g}"
            generator = generator_of(setting)
            where = board(generator, radius, in_plane=True)
            assert where.plane is not None
            width_mm = max(where.camera.image_size or (0, 0)) * RADIUS_MM / radius
            shapes = tuple(stripes(where.plane, 6.0, (150.0, 60.0), 1.2 * width_mm))
            scene = Scene(where.camera, where.discs(level), Paint(150.0), shapes=shapes)
            yield Picture(setting, photographed(rendered(scene), 2.0, generator), where.camera, where.discs(0.0))
        for name, level in (("disc of 200", 200.0), ("disc of 95, polarity changes", 95.0)):
            setting = f"grounds of 50 and 140, {name}, r {radius:g}"
            generator = generator_of(setting)
            where = board(generator, radius)
            halves = tuple(_halves(where, 140.0, generator))
            scene = Scene(where.camera, where.discs(level), Paint(50.0), shapes=halves)
            yield Picture(setting, photographed(rendered(scene), 2.0, generator), where.camera, where.discs(0.0))
        for amplitude in (10.0, 25.0):
            setting = f"mottle of {amplitude:g} on 80, disc of 180, r {radius:g}"
            generator = generator_of(setting)
            where = board(generator, radius)
            ground = Paint(80.0, Texture(amplitude, 12.0, 7))
            scene = Scene(where.camera, where.discs(180.0), ground)
            yield Picture(setting, photographed(rendered(scene), 2.0, generator), where.camera, where.discs(0.0))


def rough() -> Iterator[Picture]:
    """Rims that depart from the circle by 0.5 to 3 % of the radius."""
    for radius in (15.0, 30.0, 60.0):
        for share in (0.005, 0.01, 0.02, 0.03):
            setting = f"rough by {share:.1%}, r {radius:g}"
            generator = generator_of(setting)
            where = board(generator, radius)
            discs = where.discs(60.0)
            shapes = tuple(rough_patch(disc, share, 60.0, generator) for disc in discs)
            scene = Scene(where.camera, (), Paint(170.0), shapes=shapes)
            yield Picture(setting, photographed(rendered(scene), 2.0, generator), where.camera, discs)


def faint() -> Iterator[Picture]:
    """Faint discs at noise 1.5 beside as many of contrast 140; the faint ones are counted."""
    for radius in (15.0, 30.0):
        for contrast in (8.0, 15.0, 25.0):
            setting = f"{contrast:g} levels beside 140, r {radius:g}"
            generator = generator_of(setting)
            where = board(generator, radius)
            levels = np.where(np.arange(len(where.poses)) % 2, 200.0 - contrast, 60.0)
            discs = where.discs(levels.tolist())
            image = photographed(rendered(Scene(where.camera, discs, Paint(200.0))), 1.5, generator)
            yield Picture(setting, image, where.camera, discs[1::2], discs[::2])


def dots() -> Iterator[Picture]:
    """Dots of 5 to 10 px across, contrast 120."""
    for diameter in (5.0, 6.0, 7.0, 8.0, 10.0):
        for noise_levels in (2.0, 8.0):
            setting = f"dots of {diameter:g} px, noise {noise_levels:g}"
            generator = generator_of(setting)
            where = board(generator, diameter / 2.0, size=(8, 5))
            discs = where.discs(190.0)
            image = photographed(rendered(Scene(where.camera, discs, Paint(70.0))), noise_levels, generator)
            yield Picture(setting, image, where.camera, discs)


def boards() -> Iterator[Picture]:
    """Boards of 6 x 4 discs in a plane, tape over each: 67 to 75 % of the rim is seen."""
    for radius in (15.0, 30.0):
        for number in range(3):
            setting = f"24 taped discs, r {radius:g}"
            generator = generator_of(setting, number)
            where = board(generator, radius, size=(6, 4), in_plane=True)
            discs = where.discs(60.0)
            tape: list[Patch] = []
            for disc in discs:
                tape += hiding(disc, generator.uniform(0.25, 0.33), 1, generator.uniform(120.0, 160.0), generator)
            scene = Scene(where.camera, discs, Paint(190.0), occluders=tuple(tape))
            yield Picture(setting, photographed(rendered(scene), 2.0, generator), where.camera, discs)


def raw() -> Iterator[Picture]:
    """Raw Bayer mosaics in one channel, interlaced fields, doubled pixels."""
    for name, disc, ground in (
        ("red on green", (40.0, 40.0, 200.0), (60.0, 120.0, 40.0)),
        ("light on dark gray", (190.0, 190.0, 190.0), (60.0, 60.0, 60.0)),
        ("warm light, green gain 2", (60.0, 200.0, 110.0), (25.0, 90.0, 50.0)),
    ):
        for order in ("RGGB", "GRBG"):
            setting = f"Bayer {order}, {name}, r 30"
            where, share, generator = _share(setting, 30.0)
            image = mosaic(_colored(share, disc, ground, generator), order)
            yield Picture(setting, image, where.camera, where.discs(0.0))
    for shift in (2, 4, 8):
        # The truth is midway between the fields.
        setting = f"interlaced, {shift} px shift, r 30"
        where, share, generator = _share(setting, 30.0)
        image = photographed(190.0 - 130.0 * share, 2.0, generator)
        image[::2] = np.roll(image[::2], -shift // 2, axis=1)
        image[1::2] = np.roll(image[1::2], shift // 2, axis=1)
        yield Picture(setting, image, where.camera, where.discs(0.0))
    where, share, generator = _share("doubled", 30.0)
    height, width = share.shape
    binned = share.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3))
    image = photographed(190.0 - 130.0 * binned, 2.0, generator).repeat(2, axis=0).repeat(2, axis=1)
    yield Picture("doubled pixels, r 30", image, where.camera, where.discs(0.0))


def mosaic(image: Image, order: str) -> Image:
    """Return the pixels (h, w) of a sensor whose filters are in this order, of BGR pixels."""
    raw_pixels = np.empty(image.shape[:2], image.dtype)
    for number, letter in enumerate(order):
        at = (slice(number // 2, None, 2), slice(number % 2, None, 2))
        raw_pixels[at] = image[..., "BGR".index(letter)][at]
    return raw_pixels


FAMILIES: dict[str, Callable[[], Iterator[Picture]]] = {
    "noise": noise,
    "blur": blur,
    "defocus": defocus,
    "blurred-noise": blurred_noise,
    "hidden": hidden,
    "color": color,
    "16-bit": sixteen_bit,
    "backgrounds": backgrounds,
    "rough": rough,
    "faint": faint,
    "dots": dots,
    "boards": boards,
    "raw": raw,
}


def _share(setting: str, radius: float) -> tuple[Board, FloatArray, np.random.Generator]:
    """Return discs, and the share (h, w) of each pixel that they have."""
    generator = generator_of(setting)
    where = board(generator, radius)
    return where, rendered(Scene(where.camera, where.discs(1.0), Paint(0.0))), generator


def _counts(setting: str) -> tuple[Board, FloatArray, np.random.Generator]:
    where, share, generator = _share(setting, 30.0)
    return where, np.rint(8000.0 + 400.0 * share + 20.0 * generator.standard_normal(share.shape)), generator


def _colored(
    share: FloatArray,
    disc: tuple[float, float, float],
    ground: tuple[float, float, float],
    generator: np.random.Generator,
) -> Image:
    """Return BGR pixels of noise 3."""
    levels = np.array(ground) + share[..., None] * (np.array(disc) - np.array(ground))
    return photographed(levels, 3.0, generator)


def _halves(where: Board, level: float, generator: np.random.Generator) -> Iterator[Patch]:
    """Yield an upright band behind each column of discs, whose left border crosses them."""
    width, height = where.camera.image_size or (0, 0)
    cell = width / 4.0
    for column in range(4):
        border = (column + 0.5 + generator.uniform(-0.12, 0.12)) * cell
        yield Patch(Box(size=(0.5 * cell, 2.0 * height), at=(border + 0.25 * cell, 0.5 * height)), Paint(level))


def counted(pictures: Iterator[Picture]) -> dict[str, list[Picture]]:
    """Return the images by setting, in order."""
    rows: dict[str, list[Picture]] = {}
    for picture in pictures:
        rows.setdefault(picture.setting, []).append(picture)
    return rows
