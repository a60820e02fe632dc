from __future__ import annotations

import os
import shutil
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.io.text.escaping import guarded, printable, quoted, redacted, unguarded, unquoted

# Names as Linux has them: any bytes but / and NUL, as Python shows them.
BYTE_NAMES = st.binary(min_size=1, max_size=20).filter(lambda raw: b"\0" not in raw).map(os.fsdecode)
TRICKY = st.text("'$\\=-+@nx41uU\n\t\r\x1b\x85\u202e\udce9é ", max_size=12)


@given(BYTE_NAMES | TRICKY | st.text(max_size=20))
def test_every_cell_names_one_file_and_steers_nothing(name: str) -> None:
    for controls in (False, True):
        shown = quoted(name, keep_controls=controls)
        assert shown.encode("utf-8").decode("utf-8") == shown
        assert unquoted(shown) == name
    cell = guarded(quoted(name))
    assert unquoted(unguarded(cell)) == name
    assert len(cell.splitlines()) <= 1
    assert not cell.startswith(("=", "+", "-", "@", "\t", "\r"))
    assert "\x1b" not in cell
    assert printable(name).isprintable()


@pytest.mark.parametrize(
    "name", ["a.png", "imgs\\new.png", "it's.png", "é 图.png", "Screenshot 9.41\u202fAM.png", "$a", ""]
)
def test_ordinary_names_stand_as_they_are(name: str) -> None:
    assert quoted(name) == guarded(name) == name


@pytest.mark.parametrize("name", [b"caf\xe9.png", b"a\nb\t\r\x1b[0m", b"\x01'\\", "\x85é\u202e\n".encode(), b"$'x'"])
def test_a_shell_takes_a_quoted_name_as_it_stands(name: bytes) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("needs bash")
    command = f"printf %s {quoted(os.fsdecode(name))}"
    done = subprocess.run([bash, "-c", command], capture_output=True, check=True, env={"LC_ALL": "C.UTF-8"})
    assert done.stdout == name


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("s3://key:secret@bucket/a.png", "s3://***@bucket/a.png"),
        ("https://h/a.png?X-Amz-Signature=ab&x=1", "https://h/a.png?***"),
        ("https://h/a.png#token=ab", "https://h/a.png?***"),
        ("abfs://c/a.png?sig=ab%3D", "abfs://c/a.png?***"),
        ("403, url='https://u:p@h/a?sig=x' and http://h/b?k", "403, url='https://***@h/a?*** and http://h/b?***"),
        ("s3://bucket/img?.png", "s3://bucket/img?.png"),
        ("imgs/a@2x.png?b=c", "imgs/a@2x.png?b=c"),
        ("https://h/x@2x.png", "https://h/x@2x.png"),
    ],
)
def test_credentials_in_urls_are_hidden(text: str, shown: str) -> None:
    assert redacted(text) == shown
