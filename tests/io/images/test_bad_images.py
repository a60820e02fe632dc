"""Files that are no image, or cannot be had: each a status, none a wait, a word on stderr or a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from circlepose.errors import ImageError
from circlepose.io.images.decoder_messages import decoders_quiet
from circlepose.io.images.formats import JPEG_2000_VARIABLE
from circlepose.io.images.reader import decode_image, read_image

IMAGE = cv2.GaussianBlur(np.random.default_rng(5).integers(0, 255, (60, 90, 3), np.uint8), (0, 0), 2.0)
POSIX = pytest.mark.skipif(os.name != "posix", reason="needs POSIX files")


def encoded(suffix: str) -> bytes:
    return cv2.imencode(suffix, IMAGE)[1].tobytes()


def refusal(path: Path | str) -> tuple[str, str]:
    with pytest.raises(ImageError) as caught:
        read_image(path)
    return caught.value.status, str(caught.value)


@POSIX
def test_a_pipe_that_nobody_writes_to_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.png")
    assert refusal(tmp_path / "a.png") == (
        "unreadable",
        f"{tmp_path / 'a.png'}: is a pipe or a device, not an image file.",
    )


@POSIX
@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_devices(tmp_path: Path, device: str) -> None:
    (tmp_path / "a.png").symlink_to(device)
    status, text = refusal(tmp_path / "a.png")
    assert (status, "a pipe or a device" in text) == ("unreadable", True)


@POSIX
def test_links_in_a_circle_or_to_nothing(tmp_path: Path) -> None:
    (tmp_path / "a.png").symlink_to("b.png")
    (tmp_path / "b.png").symlink_to("a.png")
    (tmp_path / "c.png").symlink_to("none.png")
    assert refusal(tmp_path / "a.png")[0] == "unreadable"
    assert "no such file" in refusal(tmp_path / "c.png")[1]


def test_a_folder_that_is_named_like_an_image_and_an_empty_file(tmp_path: Path) -> None:
    (tmp_path / "x.png").mkdir()
    (tmp_path / "y.png").touch()
    assert refusal(tmp_path / "x.png") == ("unreadable", f"{tmp_path / 'x.png'}: is a folder, not an image file.")
    assert refusal(tmp_path / "y.png") == ("not_an_image", f"{tmp_path / 'y.png'}: is empty.")


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "a.png").open("wb") as handle:
        handle.write(encoded(".png"))
        handle.truncate(1 << 33)
    with (tmp_path / "b.png").open("wb") as handle:
        handle.truncate(1 << 33)
    assert refusal(tmp_path / "a.png")[0] == "too_large"
    assert "8589934592 bytes" in refusal(tmp_path / "a.png")[1]
    assert refusal(tmp_path / "b.png")[0] == "not_an_image"


AS_NOBODY = """
import os, sys
from circlepose.errors import CircleposeError
from circlepose.io.images.reader import read_image
from circlepose.io.inputs.images import expand_inputs
os.setgroups([])
os.setuid(65534)
for path in sys.argv[1:]:
    try:
        for image in expand_inputs([path], recursive=True):
            read_image(image.path)
        print("read")
    except CircleposeError as error:
        print(getattr(error, "status", "refused"), str(error).replace(os.path.dirname(sys.argv[1]), ""))
"""


@POSIX
@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="drops privileges, so needs root")
def test_files_and_folders_without_permission(project_root: Path) -> None:
    # Not in tmp_path, which others than its owner may not search.
    import tempfile  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as name:
        base = Path(name)
        base.chmod(0o755)
        for folder, mode in (("open", 0o755), ("closed", 0o000), ("unlisted", 0o711), ("above/closed", 0o000)):
            (base / folder).mkdir(parents=True)
            (base / folder / "a.png").write_bytes(encoded(".png"))
            (base / folder / "a.png").chmod(0o644)
            (base / folder).chmod(mode)
        (base / "above" / "b.png").write_bytes(encoded(".png"))
        (base / "secret.png").write_bytes(encoded(".png"))
        (base / "secret.png").chmod(0o600)
        paths = [
            "open",
            "secret.png",
            "closed/a.png",
            "closed",
            "unlisted",
            "unlisted/a.png",
            "above",
            "above/closed/*",
        ]
        done = subprocess.run(
            [sys.executable, "-c", AS_NOBODY, *(str(base / path) for path in paths)],
            capture_output=True, text=True, check=False, cwd="/", env={**os.environ, "PYTHONPATH": str(project_root)},
        )  # fmt: skip
    if "ModuleNotFoundError" in done.stderr or "Permission" in done.stderr:
        pytest.skip("the interpreter may not be used by others")
    assert done.stderr == ""
    may_not = "may not be read (permission denied)."
    no_folder = "the folder cannot be read (Permission denied)."
    assert done.stdout.splitlines() == [
        "read",
        f"unreadable /secret.png: {may_not}",
        f"unreadable /closed/a.png: {may_not}",
        f"refused /closed: {no_folder}",
        f"refused /unlisted: {no_folder}",
        "read",
        f"refused /above/closed: {no_folder}",
        f"refused /above/closed: {no_folder}",
    ]


def flipped(content: bytes, position: int, bit: int) -> bytes:
    changed = bytearray(content)
    changed[position] ^= 1 << bit
    return bytes(changed)


@pytest.fixture(autouse=True)
def _jpeg_2000_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(JPEG_2000_VARIABLE, "1")


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tif", ".webp", ".ppm", ".jp2"])
def test_decoders_print_nothing_about_damage(suffix: str, capfd: pytest.CaptureFixture[str]) -> None:
    content = encoded(suffix)
    for position in range(0, len(content), max(1, len(content) // 60)):
        with suppress(ImageError):
            decode_image(flipped(content, position, 3), "a")
    assert capfd.readouterr().err == ""


def test_a_jpeg_whose_pixels_are_made_up_is_refused() -> None:
    content = encoded(".jpg")
    end = content.rindex(b"\xff\xd9")
    with pytest.raises(ImageError, match="is damaged or ends early") as caught:
        decode_image(content[: end - 200] + content[end:], "a")
    assert caught.value.status == "truncated_image"


def test_what_others_write_to_stderr_is_passed_on(capfd: pytest.CaptureFixture[str]) -> None:
    with decoders_quiet() as lines:
        os.write(2, b"one of ours\nlibpng error: IDAT: CRC error\n")
        os.write(2, b"Corrupt JPEG data: bad Huffman code\nand \xff another")
    assert lines == ["libpng error: IDAT: CRC error", "Corrupt JPEG data: bad Huffman code"]
    assert capfd.readouterr().err.startswith("one of ours\nand ")
    os.write(2, b"afterwards")
    assert capfd.readouterr().err == "afterwards"


def test_threads_that_decode_leave_stderr_as_it_was(capfd: pytest.CaptureFixture[str]) -> None:
    before = open_files()
    damaged = flipped(encoded(".png"), 200, 1)

    def decode() -> None:
        for _ in range(30):
            with pytest.raises(ImageError):
                decode_image(damaged, "a")

    threads = [threading.Thread(target=decode) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    os.write(2, b"still here")
    assert capfd.readouterr().err == "still here"
    assert open_files() == before


def open_files() -> int:
    folder = Path("/proc/self/fd")
    return sum(1 for _ in folder.iterdir()) if folder.is_dir() else 0


@POSIX
def test_a_process_without_stderr_decodes_too(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(encoded(".png"))
    code = (
        "import os, sys; os.close(2); from circlepose.io.images.reader import read_image; "
        "print(read_image(sys.argv[1]).shape)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "a.png")], capture_output=True, text=True, check=False
    )
    assert done.stdout == "(60, 90, 3)\n"
