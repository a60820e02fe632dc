from __future__ import annotations

import itertools
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from circlepose._typing import Image
from circlepose.errors import ImageError, OutputError
from circlepose.io.images.formats import JPEG_2000_VARIABLE, is_image_name
from circlepose.io.images.pages import more_pages
from circlepose.io.images.reader import IMAGE_SUFFIXES, read_image, read_photograph, write_image

HEIGHT, WIDTH = 60, 90


def picture(dtype: type = np.uint8, channels: int = 3) -> Image:
    noise = np.random.default_rng(7).integers(0, np.iinfo(dtype).max, (HEIGHT, WIDTH, channels), dtype)
    return cv2.GaussianBlur(noise, (0, 0), 2.0).reshape((HEIGHT, WIDTH, channels)[: 3 if channels > 1 else 2])


def encoded(suffix: str, image: Image | None = None) -> bytes:
    done, data = cv2.imencode(suffix, picture() if image is None else image)
    assert done
    return data.tobytes()


def status_of(path: Path) -> str:
    with pytest.raises(ImageError) as caught:
        read_image(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert str(caught.value).endswith(".")
    return caught.value.status


def with_exif(jpeg: bytes, orientation: int, thumbnail: bytes = b"") -> bytes:
    entry = struct.pack("<HHI4s", 0x0112, 3, 1, struct.pack("<HH", orientation, 0))
    tiff = b"II*\0\x08\0\0\0" + struct.pack("<H", 1) + entry + b"\0\0\0\0" + thumbnail
    body = b"Exif\0\0" + tiff
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + jpeg[2:]


def png_chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


@pytest.mark.parametrize(
    ("suffix", "dtype", "channels"),
    [
        *itertools.product([".png", ".tif"], [np.uint8, np.uint16], [1, 3]),
        *itertools.product([".pgm"], [np.uint8, np.uint16], [1]),
        *itertools.product([".ppm"], [np.uint8, np.uint16], [3]),
        (".bmp", np.uint8, 1),
        (".bmp", np.uint8, 3),
        (".webp", np.uint8, 3),
    ],
)
def test_pixels_come_as_stored(tmp_path: Path, suffix: str, dtype: type, channels: int) -> None:
    image = picture(dtype, channels)
    path = tmp_path / f"a{suffix}"
    path.write_bytes(encoded(suffix, image))
    read = read_image(path)
    assert (read.dtype, read.shape) == (image.dtype, image.shape)
    np.testing.assert_array_equal(read, image)


def test_alpha_is_kept(tmp_path: Path) -> None:
    image = picture(channels=4)
    write_image(tmp_path / "a.png", image)
    np.testing.assert_array_equal(read_image(str(tmp_path / "a.png")), image)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_not_applied(tmp_path: Path, orientation: int) -> None:
    jpeg = encoded(".jpg")
    (tmp_path / "a.jpg").write_bytes(with_exif(jpeg, orientation))
    plain = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read_image(tmp_path / "a.jpg"), plain)
    if orientation == 6:
        turned = cv2.imread(str(tmp_path / "a.jpg"))
        assert turned is not None
        assert turned.shape[:2] == (WIDTH, HEIGHT), "the trap is still there"


@pytest.mark.parametrize("name", ["é 图.png", b"caf\xe9.png", "[a]*.png", "-.png", "noending"])
def test_any_file_name(tmp_path: Path, name: str | bytes) -> None:
    path = tmp_path / os.fsdecode(name)
    try:
        path.write_bytes(encoded(".png"))
    except OSError:
        pytest.skip("the file system does not take this name")
    np.testing.assert_array_equal(read_image(path), picture())


def test_missing_folder_and_unreadable(tmp_path: Path) -> None:
    assert status_of(tmp_path / "none.png") == "unreadable"
    assert status_of(tmp_path) == "unreadable"
    assert status_of(tmp_path / ("x" * 300)) == "unreadable"
    with pytest.raises(ImageError, match="NUL") as caught:
        read_image("a\0b")
    assert caught.value.status == "unreadable"


@pytest.mark.parametrize(
    "content",
    [b"", b"hello, this is text\n" * 9, b"\0" * 500, b"BMW builds cars, not images\n" * 3, b"%PDF-1.4\n", b"II"],
)
def test_not_an_image(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.png").write_bytes(content)
    assert status_of(tmp_path / "a.png") == "not_an_image"


def test_float_images_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.tif").write_bytes(encoded(".tif", picture().astype(np.float32)))
    with pytest.raises(ImageError, match="float32; expected 8- or 16-bit") as caught:
        read_image(tmp_path / "a.tif")
    assert caught.value.status == "not_an_image"


@pytest.fixture(autouse=True)
def _jpeg_2000_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(JPEG_2000_VARIABLE, "1")


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tif", ".webp", ".ppm", ".jp2"])
@pytest.mark.parametrize("lost", [1, 2, 13, 0.1, 0.5, 0.9])
def test_every_truncation_is_told(
    tmp_path: Path, suffix: str, lost: float, capfd: pytest.CaptureFixture[str]
) -> None:
    data = encoded(suffix)
    path = tmp_path / f"a{suffix}"
    path.write_bytes(data[: -int(lost if lost >= 1 else lost * len(data))])
    assert status_of(path) == "truncated_image"
    assert capfd.readouterr().err == ""


def test_a_truncated_jpeg_with_the_end_of_its_thumbnail(tmp_path: Path) -> None:
    whole = with_exif(encoded(".jpg"), 1, thumbnail=encoded(".jpg", picture()[:8, :8]))
    path = tmp_path / "a.jpg"
    path.write_bytes(whole)
    assert read_image(path).shape == (HEIGHT, WIDTH, 3)
    path.write_bytes(whole[:-200])
    assert status_of(path) == "truncated_image"
    path.write_bytes(whole[:-200] + bytes(200))
    assert status_of(path) == "truncated_image"


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_what_follows_the_end_does_no_harm(tmp_path: Path, suffix: str) -> None:
    data = encoded(suffix)
    (tmp_path / "a").write_bytes(data + b"\0" * 99)
    (tmp_path / "b").write_bytes(data)
    np.testing.assert_array_equal(read_image(tmp_path / "a"), read_image(tmp_path / "b"))


@pytest.mark.parametrize("suffix", [".bmp", ".tif", ".png"])
def test_a_damaged_file_is_told(tmp_path: Path, suffix: str) -> None:
    data = encoded(suffix)
    middle = len(data) // 2
    (tmp_path / "a").write_bytes(data[:middle] + data[middle + 40 :])
    assert status_of(tmp_path / "a") == "truncated_image"


def test_remarks_in_a_png_change_nothing_and_print_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    data = encoded(".png")
    bad_profile = png_chunk(b"iCCP", b"sRGB\0\0" + zlib.compress(b"no profile"))
    bad_gamma = png_chunk(b"gAMA", b"\0\0\0\0")
    path = tmp_path / "a.png"
    path.write_bytes(data[:33] + bad_profile + bad_gamma + data[33:-12] + png_chunk(b"tEXt", b"a\0b") + data[-12:])
    np.testing.assert_array_equal(read_image(path), picture())
    assert capfd.readouterr().err == ""


def test_the_alpha_of_a_palette_is_kept(tmp_path: Path) -> None:
    header = struct.pack(">IIBBBBB", 2, 1, 8, 3, 0, 0, 0)
    content = (
        b"\x89PNG\r\n\x1a\n"
        + png_chunk(b"IHDR", header)
        + png_chunk(b"PLTE", bytes([1, 2, 3, 4, 5, 6]))
        + png_chunk(b"tRNS", bytes([0, 255]))
        + png_chunk(b"IDAT", zlib.compress(bytes([0, 0, 1])))
        + png_chunk(b"IEND", b"")
    )
    (tmp_path / "a.png").write_bytes(content)
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), [[[3, 2, 1, 0], [6, 5, 4, 255]]])


def test_opencvs_log_is_as_loud_after_as_before(tmp_path: Path) -> None:
    logging = getattr(cv2.utils, "logging", cv2)
    before = logging.setLogLevel(3)
    try:
        (tmp_path / "a.bmp").write_bytes(encoded(".bmp")[:-5])
        status_of(tmp_path / "a.bmp")
        assert logging.setLogLevel(before) == 3
    finally:
        logging.setLogLevel(before)


def test_writing(tmp_path: Path) -> None:
    write_image(tmp_path / "é.PNG", picture(np.uint16))
    np.testing.assert_array_equal(read_image(tmp_path / "é.PNG"), picture(np.uint16))
    with pytest.raises(OutputError, match=r"a\.txt: expected a name that ends in"):
        write_image(tmp_path / "a.txt", picture())
    with pytest.raises(OutputError, match="does not exist"):
        write_image(tmp_path / "none" / "a.png", picture())
    with pytest.raises(OutputError, match="cannot be stored as"):
        write_image(tmp_path / "a.png", np.zeros((2, 2, 7), np.uint8))
    assert [path.name for path in tmp_path.iterdir()] == ["é.PNG"]


def test_suffixes() -> None:
    assert {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm"} <= IMAGE_SUFFIXES
    assert is_image_name("a/B.JPG")
    assert not is_image_name("png")


def test_expanding_inputs_does_not_load_opencv() -> None:
    code = "import sys, circlepose.io.inputs.images; sys.exit('cv2' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_real_images_are_read_as_opencv_reads_them(shared_data: Path) -> None:
    paths = [sorted(folder.iterdir())[0] for folder in sorted(shared_data.glob("*/images"))]
    assert paths
    for path in paths:
        np.testing.assert_array_equal(read_image(path), cv2.imread(str(path), cv2.IMREAD_UNCHANGED))


@pytest.mark.parametrize(("pages", "dtype"), [(1, np.uint8), (3, np.uint8), (2, np.uint16)])
def test_more_pages_of_a_tiff_are_remarked_on(tmp_path, pages, dtype):
    path = tmp_path / "a.tif"
    assert cv2.imwritemulti(str(path), [picture(dtype)] * pages)
    image, remark = read_photograph(path)
    np.testing.assert_array_equal(image, picture(dtype))
    assert remark == (
        "" if pages == 1 else f"has {pages} pages; only the first was measured, split the file to measure all"
    )


def test_a_chain_of_pages_that_is_a_loop_ends():
    first = b"II*\0" + (8).to_bytes(4, "little") + (0).to_bytes(2, "little") + (8).to_bytes(4, "little")
    assert "pages" not in more_pages(first, "TIFF")
    assert more_pages(b"MM\0*\xff\xff\xff\xff", "TIFF") == ""
