from __future__ import annotations

import itertools
import struct

import cv2
import numpy as np
import pytest

from circlepose.errors import ImageError
from circlepose.io.images import header_size
from circlepose.io.images.formats import JPEG_2000_VARIABLE, known_format
from circlepose.io.images.header_size import MAX_PIXELS, PIXELS_VARIABLE, stated_size
from circlepose.io.images.reader import decode_image

WIDTH, HEIGHT = 75, 46
IMAGE = np.arange(WIDTH * HEIGHT * 3, dtype=np.uint8).reshape(HEIGHT, WIDTH, 3)


def encoded(suffix: str, options: tuple[int, ...] = (), image=IMAGE) -> bytes:
    done, data = cv2.imencode(suffix, image, options)
    assert done
    return data.tobytes()


def big_tiff(width: int, height: int, order: str = "<") -> bytes:
    head = b"II+\0" if order == "<" else b"MM\0+"
    entries = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8)]
    directory = struct.pack(order + "Q", len(entries))
    for tag, form, count, value in entries:
        directory += struct.pack(order + "HHQ", tag, form, count) + struct.pack(
            order + "HHI" if form == 3 else order + "II", *((value, 0, 0) if form == 3 else (value, 0))
        )
    return head + struct.pack(order + "HHQ", 8, 0, 16) + directory


ENCODINGS = {
    "png": encoded(".png"),
    "png 16": encoded(".png", image=IMAGE.astype(np.uint16)),
    "jpeg": encoded(".jpg"),
    "jpeg progressive": encoded(".jpg", (cv2.IMWRITE_JPEG_PROGRESSIVE, 1)),
    "tiff": encoded(".tif"),
    "tiff deflate": encoded(".tif", (cv2.IMWRITE_TIFF_COMPRESSION, 8)),
    "bmp": encoded(".bmp"),
    "webp": encoded(".webp", (cv2.IMWRITE_WEBP_QUALITY, 80)),
    "webp lossless": encoded(".webp"),
    "webp alpha": encoded(".webp", (cv2.IMWRITE_WEBP_QUALITY, 80), np.dstack([IMAGE, IMAGE[:, :, 0]])),
    "pgm": encoded(".pgm", image=IMAGE[:, :, 0]),
    "ppm ascii": encoded(".ppm", (cv2.IMWRITE_PXM_BINARY, 0)),
    "pam": encoded(".pam"),
    "jp2": encoded(".jp2"),
}


@pytest.fixture(autouse=True)
def _jpeg_2000_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(JPEG_2000_VARIABLE, "1")


@pytest.mark.parametrize("name", ENCODINGS)
def test_the_header_states_the_size_that_the_decoder_gives(name: str) -> None:
    content = ENCODINGS[name]
    kind = known_format(content)
    assert kind is not None
    assert stated_size(content, kind) == (WIDTH, HEIGHT)
    assert decode_image(content, "a").shape[:2] == (HEIGHT, WIDTH)


@pytest.mark.parametrize(("content", "kind"), [(big_tiff(7, 9), "TIFF"), (big_tiff(7, 9, ">"), "TIFF")])
def test_forms_that_opencv_does_not_write(content: bytes, kind: str) -> None:
    assert known_format(content) == kind
    assert stated_size(content, kind) == (7, 9)


def test_comments_in_a_pgm_and_rubbish_in_a_jpeg_are_passed_over() -> None:
    assert stated_size(b"P5 # a remark 1 2\n# another\n37\n#x\r23 255\n", "PNM") == (37, 23)
    jpeg = ENCODINGS["jpeg"]
    assert stated_size(jpeg[:20] + b"\0\1\2" + jpeg[20:], "JPEG") == (WIDTH, HEIGHT)


@pytest.mark.parametrize("name", ENCODINGS)
def test_no_cut_header_is_misread(name: str) -> None:
    content = ENCODINGS[name]
    kind = known_format(content)
    assert kind is not None
    for end in range(min(len(content), 900)):
        size = stated_size(content[:end], kind)
        # Digits of a PNM may be cut off.
        assert size in {None, (WIDTH, HEIGHT)} or kind == "PNM"


def enlarged(name: str, width: int, height: int) -> bytes:
    """Return an image whose header, but nothing else, is of another size."""
    content, kind = bytearray(ENCODINGS[name]), name.split(maxsplit=1)[0]
    if kind == "png":
        struct.pack_into(">II", content, 16, width, height)
    elif kind == "bmp":
        struct.pack_into("<ii", content, 18, width, -height)
    elif kind == "jpeg":
        frame = next(at for at in range(len(content)) if content[at] == 0xFF and content[at + 1] in (0xC0, 0xC2))
        struct.pack_into(">HH", content, frame + 5, height, width)
    elif kind == "jp2":
        start = content.find(b"\xff\x4f\xff\x51")
        struct.pack_into(">II", content, start + 8, width, height)
    elif kind in {"pgm", "ppm", "pam"}:
        text = bytes(content).replace(b"75", b"%d" % width, 1).replace(b"46", b"%d" % height, 1)
        return text
    elif kind == "tiff":
        (directory,) = struct.unpack_from("<I", content, 4)
        (count,) = struct.unpack_from("<H", content, directory)
        for entry in range(directory + 2, directory + 2 + 12 * count, 12):
            tag = struct.unpack_from("<H", content, entry)[0]
            if tag in (256, 257):
                struct.pack_into("<HII", content, entry + 2, 4, 1, width if tag == 256 else height)
    else:
        content[24:27], content[27:30] = (width - 1).to_bytes(3, "little"), (height - 1).to_bytes(3, "little")
    return bytes(content)


@pytest.mark.parametrize(
    ("name", "side"),
    [
        *itertools.product(["png", "tiff", "bmp", "pgm", "ppm ascii", "pam", "jp2"], [20_000, 100_000]),
        ("jpeg", 60_000),
        ("webp alpha", 20_000),
    ],
)
def test_a_bomb_is_refused_with_its_size_before_it_is_decoded(
    name: str, side: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cv2, "imdecode", None)
    with pytest.raises(ImageError) as caught:
        decode_image(enlarged(name, side, side), "a")
    assert caught.value.status == "too_large"
    assert f"is {side} x {side} px, over the limit of {MAX_PIXELS} px" in str(caught.value)
    assert PIXELS_VARIABLE in str(caught.value)


def test_a_long_side_alone_is_too_large() -> None:
    with pytest.raises(ImageError, match=r"2000000 x 10 px, over OpenCV's limit of 1048576 px a side") as caught:
        decode_image(enlarged("png", 2_000_000, 10), "a")
    assert caught.value.status == "too_large"


def test_the_limit_is_opencvs_own_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PIXELS_VARIABLE, str(WIDTH * HEIGHT))
    assert decode_image(ENCODINGS["png"], "a").shape[:2] == (HEIGHT, WIDTH)
    monkeypatch.setenv(PIXELS_VARIABLE, str(WIDTH * HEIGHT - 1))
    with pytest.raises(ImageError, match=f"over the limit of {WIDTH * HEIGHT - 1} px"):
        decode_image(ENCODINGS["png"], "a")
    monkeypatch.setenv(PIXELS_VARIABLE, "many")
    assert header_size.max_pixels() == MAX_PIXELS


def with_scans(number: int, width: int, height: int) -> bytes:
    """Return a progressive JPEG of that size by its header, whose last scan is there so many times."""
    content = enlarged("jpeg progressive", width, height)
    last, end = content.rindex(b"\xff\xda"), content.rindex(b"\xff\xd9")
    already = content.count(b"\xff\xda")
    return content[:end] + content[last:end] * (number - already) + content[end:]


def test_scans_times_pixels_are_bounded_before_anything_is_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    most = header_size.SCANS_OF_LARGEST
    # Ten scans, as encoders write them, over a hundred million pixels.
    assert header_size.too_many_scans(with_scans(10, 10_000, 10_000), "JPEG", (10_000, 10_000)) is None
    assert header_size.too_many_scans(with_scans(1000, 1000, 1000), "JPEG", (1000, 1000)) is None
    monkeypatch.setattr(cv2, "imdecode", None)
    slow = with_scans(most + 6, 16_384, 16_384)
    assert len(slow) < 20_000
    with pytest.raises(
        ImageError, match=rf"has more than {most} scans, too many for an image of 16384 x 16384 px"
    ) as e:
        decode_image(slow, "a")
    assert e.value.status == "too_large"


def test_scans_are_counted_where_the_decoder_finds_them() -> None:
    size = (16_384, 16_384)
    most = header_size.SCANS_OF_LARGEST
    baseline = enlarged("jpeg", *size)
    # A remark, such as a thumbnail, is no scan; nor is what follows the end.
    remark = b"\xff\xfe" + struct.pack(">H", 2 + 200) + b"\xff\xda" * 100
    assert header_size.too_many_scans(baseline[:2] + remark + baseline[2:], "JPEG", size) is None
    assert header_size.too_many_scans(baseline, "JPEG", size) is None
    assert header_size.too_many_scans(with_scans(most + 6, *size), "JPEG", size)


def test_jpeg_2000_is_decoded_only_where_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(JPEG_2000_VARIABLE, "1")
    assert decode_image(ENCODINGS["jp2"], "a").shape[:2] == (HEIGHT, WIDTH)
    monkeypatch.setattr(cv2, "imdecode", None)
    for value in ("", "0", "yes", None):
        if value is None:
            monkeypatch.delenv(JPEG_2000_VARIABLE)
        else:
            monkeypatch.setenv(JPEG_2000_VARIABLE, value)
        with pytest.raises(ImageError, match=f"is a JPEG 2000 image.*{JPEG_2000_VARIABLE}=1") as caught:
            decode_image(ENCODINGS["jp2"], "a")
        assert caught.value.status == "not_allowed"
