"""The mark that every file of ours bears: it may be replaced, and a drawn picture is not measured as a photograph."""

from __future__ import annotations

import os
import zlib
from contextlib import suppress
from pathlib import Path

COMMENT = "# Written by circlepose"
"""a line of its own, among the first three of a YAML file of ours"""
XML_COMMENT = "<!-- circlepose -->"
JSON_MARK = '{"written_by": "circlepose"'
"""how a JSON file of another tool's form begins where we wrote it"""
HEAD_BYTES = 4096
_TAIL_BYTES = 65536
_CSV_HEADERS = (
    b"image,instance,circle,method,solution,",
    b"image,instance,circle,radius_mm,center_x_mm,",
    b"image,instance,solution,chosen,status,x_mm,",
    b"image,first,second,distance_mm,sigma_mm,",
    b"Method,Image,Circle center position,",
    b"Scene,Candidate,UN,TV,GCC",
    b"Method,Source,Image,",
    b"Reading,Perturbed,Noise (px),",
    b"Scene,Source,Candidate,UN,",
    b"Part,Tilt (deg),Scenes,",
)
_RESULT_COLUMNS = frozenset(
    (
        "sigma_x_mm",
        "sigma_y_mm",
        "sigma_z_mm",
        "sigma_normal_deg",
        "sigma_rx_deg",
        "sigma_ry_deg",
        "sigma_rz_deg",
        "circles_used",
        "circles_in_layout",
        "sigma_mm",
        "sigma_deg",
        "rim_used",
        "settled_by",
        "position_difference_mm",
        "orientation_difference_deg",
    )
)
"""One of these makes a header of chosen columns ours; `chosen` or a center may stand in a user's own."""
_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_HEAD_BYTES = 33
"""of the signature and the chunk IHDR, which comes first"""
_JPEG = b"\xff\xd8"
_PARQUET_SCHEMAS = (b"circlepose.poses/", b"circlepose.boards/", b"circlepose.pairs/")
_PDF_END = b"%circlepose\n"
_DXF_COMMENT = b"999\ncirclepose\n"
_DRAWN = b"circlepose picture"
_RENDERED = b"circlepose render"


def bears_mark(path: Path) -> bool:
    """Return whether the file at `path` is one of ours; raises `OSError` where it cannot be read."""
    with path.open("rb") as handle:
        head = handle.read(HEAD_BYTES)
        if head.startswith((b"PAR1", b"%PDF")):
            handle.seek(max(0, path.stat().st_size - _TAIL_BYTES))
            tail = handle.read()
            return (
                tail.endswith(_PDF_END)
                if head.startswith(b"%PDF")
                else any(each in tail for each in _PARQUET_SCHEMAS)
            )
    return is_marked(head)


def is_marked(head: bytes) -> bool:
    """Return whether a file that begins with `head` is one of ours."""
    if head.startswith(b"\x1f\x8b"):
        with suppress(zlib.error):
            head = zlib.decompressobj(31).decompress(head, HEAD_BYTES)
    if head.replace(b"\t", b",").startswith(_CSV_HEADERS) or _has_chosen_columns(head):
        return True
    if head.startswith((b'{"schema": "circlepose.', JSON_MARK.encode())):
        return True
    if head.startswith((b"<?xml", b"<svg")):
        return XML_COMMENT.encode() in head
    if head.startswith((_PNG, _JPEG)):
        return _picture_mark(head) in (_DRAWN, _RENDERED)
    if head.startswith(_DXF_COMMENT):
        return True
    return COMMENT.encode() in head.splitlines()[:3]


def _has_chosen_columns(head: bytes) -> bool:
    """Return whether the first line is the header of a table whose columns were chosen with --columns."""
    # A signal may come while a module is imported.
    from circlepose.io.tables.board_rows import BOARD_COLUMNS  # noqa: PLC0415
    from circlepose.io.tables.columns import COLUMNS  # noqa: PLC0415
    from circlepose.io.tables.pair_rows import PAIR_COLUMNS  # noqa: PLC0415

    line, end, _ = head.partition(b"\n")
    names = set(line.decode("ascii", errors="replace").replace("\t", ",").split(","))
    is_layout = any(names <= set(known) for known in (COLUMNS, BOARD_COLUMNS, PAIR_COLUMNS))
    return bool(end) and is_layout and not names.isdisjoint(_RESULT_COLUMNS)


def is_drawn(head: bytes) -> bool:
    """Return whether an image file that begins with `head` is a picture that was drawn over a photograph."""
    return _picture_mark(head) == _DRAWN


def is_drawn_file(path: str) -> bool:
    """Return whether the file at `path` is a picture that was drawn over a photograph; False if it cannot be read."""
    if not path.lower().endswith((".png", ".jpg", ".jpeg")):
        return False
    try:
        # A pipe of that name must not block.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except (OSError, ValueError):
        return False
    try:
        return is_drawn(os.read(descriptor, _PNG_HEAD_BYTES + 64))
    except OSError:
        return False
    finally:
        os.close(descriptor)


def with_picture_mark(content: bytes, *, drawn: bool) -> bytes:
    """Return a PNG or JPEG file with the mark of a drawn picture, or else of a rendered image; others as they are."""
    mark = _DRAWN if drawn else _RENDERED
    if content.startswith(_PNG):
        body = b"tEXt" + b"Software\0" + mark
        chunk = (len(body) - 4).to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")
        return content[:_PNG_HEAD_BYTES] + chunk + content[_PNG_HEAD_BYTES:]
    if content.startswith(_JPEG):
        return _JPEG + b"\xff\xfe" + (len(mark) + 2).to_bytes(2, "big") + mark + content[2:]
    return content


def with_plot_mark(content: bytes) -> bytes:
    """Return a PNG, SVG, PDF or DXF file with the mark of a drawn picture."""
    if content.startswith(b"<?xml"):
        declaration, _, rest = content.partition(b"\n")
        return declaration + f"\n{XML_COMMENT}\n".encode() + rest
    if content.startswith(b"%PDF"):
        return content + _PDF_END
    if content.startswith(b"  0\nSECTION"):
        return _DXF_COMMENT + content
    return with_picture_mark(content, drawn=True)


def _picture_mark(head: bytes) -> bytes:
    """Return the text of the first comment of a PNG or JPEG file, if that comes where ours stands."""
    if head.startswith(_PNG):
        length = int.from_bytes(head[_PNG_HEAD_BYTES : _PNG_HEAD_BYTES + 4], "big")
        chunk = head[_PNG_HEAD_BYTES + 4 : _PNG_HEAD_BYTES + 8 + length]
        return chunk.removeprefix(b"tEXtSoftware\0")
    if head.startswith(_JPEG + b"\xff\xfe"):
        return head[6 : 4 + int.from_bytes(head[4:6], "big")]
    return b""
