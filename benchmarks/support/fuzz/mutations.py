"""Damage done to files, by seed and case number, so that a case that fails can be named and repeated."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable

import numpy as np

Rng = np.random.Generator

SEED = 1999
_WORDS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
_NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_TOKEN = re.compile(rb"[^\s,:\[\]{}<>\"]+")
_WORDS_OF_YAML = (
    "nan .nan .NaN NaN inf -.inf .Inf 1e400 -1e400 1e308 -1e308 1e-320 -0 0 -1 1 0.5 010 0x10 1_000 1:30 ~ null true "
    "[] {} '' \"\" [1] [[]] {a:1} [1,[2]] !!binary !!python/object:os.system *a &a | > ? - : , # % @ ` ... --- << "
    "opencv-matrix pinhole fisheye equidistant omni circle coplanar coaxial all any dark １２ ٣ é \u202e \x1b[2J"
)
_LONG = (
    "9" * 400,
    "9" * 5000,
    "1" + "0" * 30,
    "x" * 3000,
    "[" * 3000,
    "{a: " * 300,
    "\t",
    "\u2028",
    "\0",
    "a: &b [*b]",
)
_VALUES = (
    *(text.encode() for text in (*_WORDS_OF_YAML.split(" "), *_LONG)),
    b"\xff",
    b"!!opencv-matrix {rows: 1e9, cols: 1e9}",
)


def generator(name: str, case: int) -> Rng:
    """Return the generator of one case of the format `name`."""
    return np.random.default_rng([SEED, zlib.crc32(name.encode()), case])


def damaged_bytes(content: bytes, rng: Rng) -> bytes:
    """Return `content` after one to three kinds of damage: cut, flipped, overwritten, moved, repeated."""
    for _ in range(int(rng.integers(1, 4))):
        if content:
            content = _BYTE_DAMAGE[int(rng.integers(len(_BYTE_DAMAGE)))](content, rng)
    return content


def damaged_png(content: bytes, rng: Rng) -> bytes:
    """Return a PNG whose chunks are damaged inside, with checksums that fit, so that the damage is met later."""
    chunks, position = [], 8
    while position + 12 <= len(content):
        (length,) = struct.unpack_from(">I", content, position)
        chunks.append((content[position + 4 : position + 8], content[position + 8 : position + 8 + length]))
        position += 12 + length
    hit = int(rng.integers(len(chunks)))
    name, data = chunks[hit]
    if name == b"IDAT" and rng.random() < 0.7:
        data = zlib.compress(damaged_bytes(zlib.decompress(data), rng))
    elif rng.random() < 0.2:
        name = bytes(damaged_bytes(name, rng)[:4].ljust(4, b"A"))
    else:
        data = damaged_bytes(data, rng)
    chunks[hit] = (name, data)
    return content[:8] + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in chunks
    )


def damaged_text(content: bytes, rng: Rng) -> bytes:
    """Return a text after one to three kinds of damage: lines and words lost, swapped, repeated, made absurd."""
    for _ in range(int(rng.integers(1, 4))):
        content = _TEXT_DAMAGE[int(rng.integers(len(_TEXT_DAMAGE)))](content, rng)
    return content


def _place(content: bytes, rng: Rng) -> int:
    """Return a position, half of the time in the header, where most is decided."""
    end = min(len(content), 120) if rng.random() < 0.5 else len(content)
    return int(rng.integers(end))


def _slice(content: bytes, rng: Rng) -> tuple[int, int]:
    start = _place(content, rng)
    return start, min(len(content), start + 1 + int(rng.integers(1 << int(rng.integers(1, 9)))))


def _cut(content: bytes, rng: Rng) -> bytes:
    return content[: _place(content, rng)]


def _flip(content: bytes, rng: Rng) -> bytes:
    changed = bytearray(content)
    for _ in range(1 << int(rng.integers(5))):
        changed[_place(content, rng)] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _overwrite(content: bytes, rng: Rng) -> bytes:
    size, order = int(rng.choice([1, 2, 4])), "little" if rng.random() < 0.5 else "big"
    word = (_WORDS[int(rng.integers(len(_WORDS)))] % (1 << 8 * size)).to_bytes(size, order)
    start = _place(content, rng)
    return content[:start] + word + content[start + size :]


def _remove(content: bytes, rng: Rng) -> bytes:
    start, end = _slice(content, rng)
    return content[:start] + content[end:]


def _repeat(content: bytes, rng: Rng) -> bytes:
    start, end = _slice(content, rng)
    return content[:end] + content[start:end] * int(rng.integers(1, 4)) + content[end:]


def _noise(content: bytes, rng: Rng) -> bytes:
    start, end = _slice(content, rng)
    return content[:start] + rng.bytes(end - start) + content[end:]


def _swap(content: bytes, rng: Rng) -> bytes:
    (a, b), (c, d) = sorted((_slice(content, rng), _slice(content, rng)))
    return content if b > c else content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]


def _lines(content: bytes, rng: Rng) -> bytes:
    lines = content.splitlines(keepends=True)
    if len(lines) < 2:
        return content
    a, b = (int(each) for each in rng.integers(len(lines), size=2))
    match int(rng.integers(5)):
        case 0:
            del lines[a]
        case 1:
            lines.insert(b, lines[a])
        case 2:
            lines[a], lines[b] = lines[b], lines[a]
        case 3:
            lines[a] = b" " * int(rng.integers(1, 9)) + lines[a]
        case _:
            lines[a] = lines[a].strip()
    return b"".join(lines)


def _numbers(content: bytes, rng: Rng) -> bytes:
    return _replaced(_NUMBER, content, rng)


def _tokens(content: bytes, rng: Rng) -> bytes:
    return _replaced(_TOKEN, content, rng)


def _replaced(pattern: re.Pattern[bytes], content: bytes, rng: Rng) -> bytes:
    found = list(pattern.finditer(content))
    if not found:
        return content
    here, there = (found[int(rng.integers(len(found)))] for _ in range(2))
    new = there[0] if rng.random() < 0.3 else _VALUES[int(rng.integers(len(_VALUES)))]
    return content[: here.start()] + new + content[here.end() :]


def _inserted(content: bytes, rng: Rng) -> bytes:
    start = int(rng.integers(len(content) + 1))
    return content[:start] + _VALUES[int(rng.integers(len(_VALUES)))] + content[start:]


_BYTE_DAMAGE: tuple[Callable[[bytes, Rng], bytes], ...] = (
    _cut, _flip, _flip, _overwrite, _overwrite, _remove, _repeat, _noise, _swap,
)  # fmt: skip
_TEXT_DAMAGE: tuple[Callable[[bytes, Rng], bytes], ...] = (
    _lines, _lines, _numbers, _numbers, _tokens, _tokens, _inserted, damaged_bytes,
)  # fmt: skip
