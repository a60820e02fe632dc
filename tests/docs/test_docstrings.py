"""The functions of the API have their sections: those of `circlepose`, and those that the pages import."""

from __future__ import annotations

import ast
import importlib
import inspect
import re

import pytest

import circlepose
from tests.support.paths import ROOT


def functions():
    """The API's functions by name."""
    found = {name: getattr(circlepose, name) for name in circlepose.__all__}
    for path in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        text = path.read_text(encoding="utf-8")
        for module, names in re.findall(r"^from (circlepose[\w.]*) import ([\w, ]+)$", text, re.MULTILINE):
            for name in names.split(", "):
                found[f"{module}.{name}"] = getattr(importlib.import_module(module), name)
    return {name: value for name, value in found.items() if inspect.isfunction(value)}


FUNCTIONS = functions()


def sections(function):
    return set(re.findall(r"^(\w+)\n-{3,}$", inspect.getdoc(function) or "", re.MULTILINE))


def test_there_are_some():
    assert {"estimate", "estimate_from_contour", "read_camera", "read_target"} <= set(FUNCTIONS)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_of_the_api_has_the_sections_that_it_needs(name):
    function = FUNCTIONS[name]
    signature = inspect.signature(function)
    has = sections(function)
    assert not signature.parameters or "Parameters" in has
    assert signature.return_annotation in ("None", None) or {"Returns", "Yields"} & has


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_parameter_is_explained(name):
    function = FUNCTIONS[name]
    part = (inspect.getdoc(function) or "").split("Parameters\n----------\n")[-1]
    part = re.split(r"^\w+\n-{3,}$", part, flags=re.MULTILINE)[0]
    named = {
        word.strip("* ") for line in re.findall(r"^(\S.*)$", part, re.MULTILINE) for word in re.split(r"[,:]", line)
    }
    assert set(inspect.signature(function).parameters) <= named


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_that_raises_says_what(name):
    function = FUNCTIONS[name]
    body = ast.parse(inspect.getsource(function))
    if any(isinstance(node, ast.Raise) for node in ast.walk(body)):
        assert "Raises" in sections(function)
