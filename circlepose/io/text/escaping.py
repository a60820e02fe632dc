r"""Names of files in tables and messages: one line, valid UTF-8, no escape sequences, and traceable to the file.

A name that cannot be shown as it is is quoted as shells do, `$'caf\xe9\n.png'`: such a cell names one file only,
and a shell takes it as it stands.
"""

from __future__ import annotations

import re

# Control characters, line separators, marks that turn the direction of text, and bytes that are no UTF-8.
_UNSHOWN = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
_TO_ESCAPE = re.compile(f"{_UNSHOWN.pattern}|[\\\\']")
_NO_UTF8 = re.compile("[\ud800-\udfff]")
_ESCAPES = {"\n": "\\n", "\r": "\\r", "\t": "\\t", "\\": "\\\\", "'": "\\'"}
_ESCAPED = re.compile(r"\\(?:x([0-9a-f]{2})|u([0-9a-f]{4})|(.))", re.DOTALL)
_FORMULA = re.compile("'*[=+\\-@\t\r\n\uff1d\uff0b\uff0d\uff20]")


def quoted(name: str, *, keep_controls: bool = False) -> str:
    r"""Return `name` as one line of UTF-8: as it is, or as `$'...'` with the escapes \n \t \r \\ \' \xNN \uNNNN.

    `\xNN` up to 7f is that character, from 80 on a byte that is not UTF-8. With `keep_controls`, only for what is
    no UTF-8, as in JSON, which has its own escapes. `unquoted` gives the name back.
    """
    if not (_NO_UTF8 if keep_controls else _UNSHOWN).search(name) and not name.startswith("$'"):
        return name
    inside = _TO_ESCAPE.sub(lambda match: _escape(match[0]), name)
    return f"$'{inside}'"


def unquoted(text: str) -> str:
    """Return the name that `quoted` shows as `text`."""
    if not (text.startswith("$'") and text.endswith("'") and len(text) > 2):
        return text
    return _ESCAPED.sub(_character, text[2:-1])


def guarded(text: str) -> str:
    """Return `text` with an apostrophe before it where a spreadsheet would run it as a formula."""
    return f"'{text}" if _FORMULA.match(text) else text


def unguarded(text: str) -> str:
    """Return the text that `guarded` made `text` of."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def printable(message: str) -> str:
    """Return `message` without what would steer a terminal, or break a line, or be no text."""
    return "".join(c if c.isprintable() else _escape(c) for c in message)


def redacted(text: str) -> str:
    """Return `text` with the credentials in its URLs hidden: `user:password@` and everything after a `?`."""
    text = re.sub(r"(://)[^/?#@\s]*@", r"\1***@", text)
    return re.sub(r"(https?://[^\s?#]*)[?#]\S*|(://[^\s?]*)\?(?=[\w.-]+=)\S*", r"\1\2?***", text)


def _escape(character: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    code = ord(character)
    if code < 0x80 or 0xDC80 <= code <= 0xDCFF:
        return f"\\x{code & 0xFF:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _character(match: re.Match[str]) -> str:
    byte, code, letter = match.groups()
    if byte is not None:
        value = int(byte, 16)
        return chr(value if value < 0x80 else 0xDC00 + value)
    if code is not None:
        return chr(int(code, 16))
    return {"n": "\n", "r": "\r", "t": "\t"}.get(letter, letter)
