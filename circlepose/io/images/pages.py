"""How many pages a TIFF has, and whether a PNG or WebP is animated: only the first page is decoded."""

from __future__ import annotations

import struct

_MOST_PAGES = 10_000
"""More are counted as this many: the chain may be a loop."""


def more_pages(content: bytes, kind: str) -> str:
    """Return what an image file holds beside the page that is decoded, in words; empty where nothing."""
    if kind == "TIFF":
        pages = _tiff_pages(content)
        return f"has {pages} pages; only the first was measured, split the file to measure all" if pages > 1 else ""
    animated = (kind == "PNG" and b"acTL" in content[:4096]) or (
        kind == "WebP" and content[12:16] == b"VP8X" and len(content) > 20 and bool(content[20] & 0x02)
    )
    return "is animated; only the first picture was measured, split the file to measure all" if animated else ""


def _tiff_pages(content: bytes) -> int:
    """Return the number of directories, each of which is a page, that are not a reduced image of another."""
    order = "<" if content[:2] == b"II" else ">"
    is_big = content[2:4] in (b"+\0", b"\0+")
    count_form, entry_bytes, offset_form = (
        (f"{order}Q", 20, f"{order}Q") if is_big else (f"{order}H", 12, f"{order}I")
    )
    pages, seen = 0, set[int]()
    try:
        (offset,) = struct.unpack_from(offset_form, content, 8 if is_big else 4)
        while offset and offset not in seen and len(seen) < _MOST_PAGES:
            seen.add(offset)
            (entries,) = struct.unpack_from(count_form, content, offset)
            start = offset + struct.calcsize(count_form)
            pages += not _is_reduced(content, order, start, entries, entry_bytes)
            (offset,) = struct.unpack_from(offset_form, content, start + entries * entry_bytes)
    except struct.error:
        # What is damaged is for the decoder to say.
        pass
    return pages


def _is_reduced(content: bytes, order: str, start: int, entries: int, entry_bytes: int) -> bool:
    """Return whether the tag NewSubfileType calls the page a thumbnail or a mask."""
    for number in range(min(entries, 64)):
        at = start + number * entry_bytes
        (tag,) = struct.unpack_from(f"{order}H", content, at)
        if tag == 254:
            (value,) = struct.unpack_from(f"{order}I", content, at + entry_bytes - (4 if entry_bytes == 12 else 8))
            return bool(value & 0b101)
    return False
