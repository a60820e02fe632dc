"""Every JSON document that the program prints or writes in a test, held against its schema."""

from __future__ import annotations

import gzip
import json
import re
from functools import cache
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from circlepose import schemas

_BEGIN = re.compile(r'\{\s*"schema": "circlepose\.')


@cache
def validator(name: str) -> Draft202012Validator:
    return Draft202012Validator(schemas.schema(name))


def faults(document: object) -> list[str]:
    """Return what the schema that a document names finds wrong with it."""
    assert isinstance(document, dict)
    found = validator(document["schema"]).iter_errors(document)
    return [f"{'/'.join(map(str, error.absolute_path))}: {error.message[:300]}" for error in found]


def documents(text: str, *, may_be_cut: bool = False) -> list[object]:
    """Return the documents in an output: one, or one a line; none where it is no JSON of circlepose."""
    if not _BEGIN.match(text):
        return []
    try:
        return [json.loads(text)]
    except json.JSONDecodeError:
        lines = text.splitlines()
    found = []
    for line in lines:
        try:
            found.append(json.loads(line))
        except json.JSONDecodeError:
            assert may_be_cut, f"no JSON: {line[:300]}"
    return found


def assert_valid(text: str, *, may_be_cut: bool = False) -> None:
    """Assert that an output of the program, if it is JSON, is what its schema says."""
    for document in documents(text, may_be_cut=may_be_cut):
        found = faults(document)
        assert not found, found


def assert_valid_files(folder: Path) -> None:
    """Assert the same of all files below `folder`."""
    for path in folder.rglob("*.json*"):
        if path.is_file():
            content = path.read_bytes()
            plain = gzip.decompress(content) if content.startswith(b"\x1f\x8b") else content
            assert_valid(plain.decode("utf-8", "replace"))


def check_captured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every reading of captured standard output assert that it is valid."""
    read = pytest.CaptureFixture.readouterr

    def checked(capture):
        captured = read(capture)
        if isinstance(captured.out, str):
            assert_valid(captured.out)
        return captured

    monkeypatch.setattr(pytest.CaptureFixture, "readouterr", checked)
