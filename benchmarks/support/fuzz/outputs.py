"""Journals whose lines are whole but hold something else, and odd places for outputs: nothing of the user is lost."""

from __future__ import annotations

import json
import os
import tempfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.support.fuzz.formats import Format
from benchmarks.support.fuzz.mutations import Rng, damaged_text
from circlepose.batch.journal import Journal
from circlepose.batch.measure import MeasureOptions, WorkItem
from circlepose.batch.resume import conditions, measure_with_journal
from circlepose.camera.camera import Camera
from circlepose.errors import CircleposeError
from circlepose.io.atomic import atomic_writer
from circlepose.io.tables.paper_layouts import write_results
from circlepose.results import Candidate, CircleResult, ImageResult
from circlepose.targets.target import Target

CAMERA = Camera.create([[400.0, 0.0, 79.5], [0.0, 400.0, 59.5], [0.0, 0.0, 1.0]], (), (160, 120))
OPTIONS = MeasureOptions()
MEASURED = ImageResult(
    "a.png",
    circles=(
        CircleResult(
            0,
            "disc",
            "chen-huang",
            20.0,
            (Candidate(np.array([0.0, 0.0, 200.0]), np.array([0.0, 0.0, -1.0]), np.array([79.5, 59.5])),),
            ambiguity=0.0,
        ),
    ),
    image_size=(160, 120),
)
ODD = (
    None,
    True,
    -1,
    7,
    1e400,
    float("nan"),
    "",
    "x",
    "\0",
    [],
    [[]],
    {},
    {"a": 1},
    10**30,
    "a.png",
    [1.0, 2.0, 3.0],
)
PRECIOUS = b"precious\n"


def formats() -> Mapping[str, Format]:
    """Return both kinds by name."""
    return {
        "journal, checksums mended": Format(_entry(), _damaged_entry, _resumed),
        "place of an output": Format(b"t.csv", _damaged_place, _written),
    }


def _item(folder: Path) -> WorkItem:
    path = folder / "a.png"
    path.write_bytes(b"x")
    os.utime(path, ns=(10**18, 10**18))
    return WorkItem(path, "a.png", CAMERA, Target.circle(20.0))


def _run(folder: Path) -> tuple[list[ImageResult], list[str], list[str]]:
    """Resume a run over one image; return results, the images that were measured and the warnings."""
    measured: list[str] = []
    warnings: list[str] = []

    def measure(items: Any) -> Any:
        for item in items:
            if not isinstance(item, ImageResult):
                measured.append(item.name)
            yield item if isinstance(item, ImageResult) else MEASURED

    path = folder / "t.csv.journal"
    with Journal(path, conditions(OPTIONS), resume=True, output="t.csv") as journal:
        results = list(measure_with_journal([_item(folder)], journal, measure, warnings.append))
    return results, measured, warnings


def _entry() -> bytes:
    """Return the values of a sound line, with a mark where the folder stands."""
    with tempfile.TemporaryDirectory() as name:
        _run(Path(name))
        line = (Path(name) / "t.csv.journal").read_bytes().splitlines()[-1]
        return line.split(b" ", 2)[2].replace(name.encode(), b"FOLDER")


def _damaged_entry(content: bytes, rng: Rng) -> bytes:
    if rng.random() < 0.2:
        return damaged_text(content, rng)
    values = json.loads(content)
    for _ in range(int(rng.integers(1, 4))):
        place: Any = values
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            if not keys:
                break
            key = keys[int(rng.integers(len(keys)))]
            if isinstance(place[key], dict | list) and place[key] and rng.random() < 0.8:
                place = place[key]
                continue
            if rng.random() < 0.3:
                del place[key]
            else:
                place[key] = ODD[int(rng.integers(len(ODD)))]
            break
    return json.dumps(values).encode()


def _resumed(content: bytes, _case: int) -> str:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run(folder)
        path = folder / "t.csv.journal"
        *before, last = path.read_bytes().splitlines(keepends=True)
        key = last.split(b" ")[1]
        body = key + b" " + content.replace(b"FOLDER", name.encode()).replace(b"\n", b" ")
        path.write_bytes(b"".join(before) + b"%08x %s\n" % (zlib.crc32(body), body))
        try:
            results, measured, _ = _run(folder)
        except CircleposeError as error:
            return _one_sentence(str(error))
        if len(results) != 1 or results[0].image != "a.png":
            raise RuntimeError(f"rows of {[result.image for result in results]}")
        for data_format in ("csv", "json", "jsonl"):
            with (folder / "rows").open("w") as handle:
                write_results(results, handle, data_format=data_format, layout="poses")  # type: ignore[arg-type]
        return "refused" if measured else "read"


def _damaged_place(content: bytes, rng: Rng) -> bytes:
    parts = (
        b"t.csv",
        b"..",
        b".",
        b"",
        b"/",
        b"victim",
        b"link",
        b"folder",
        b"pipe",
        b"\n",
        b"\xff",
        b"a" * 300,
        b"~",
        b"-",
    )
    picked = [parts[int(rng.integers(len(parts)))] for _ in range(int(rng.integers(1, 5)))]
    joined = (b"/" if rng.random() < 0.5 else b"").join(picked)
    return content if rng.random() < 0.1 else joined


def _written(content: bytes, _case: int) -> str:
    """Write to an odd place below a folder with files of a user, which must stay as they are."""
    with tempfile.TemporaryDirectory() as name:
        # Deeper than any `..` of a case leads out.
        folder = Path(name, *"123456")
        folder.mkdir(parents=True)
        victims = (folder / "victim", folder.parent / "victim")
        for victim in victims:
            victim.write_bytes(PRECIOUS)
        (folder / "link").symlink_to("victim")
        (folder / "folder").mkdir()
        # With a reader, so that it does not block.
        os.mkfifo(folder / "pipe")
        reader = os.open(folder / "pipe", os.O_RDONLY | os.O_NONBLOCK)
        place = os.fsdecode(os.fsencode(folder) + b"/" + content.lstrip(b"/"))
        try:
            with atomic_writer(place, binary=True) as handle:
                handle.write(b"new")
            outcome = "read"
        except CircleposeError as error:
            outcome = _one_sentence(str(error))
        finally:
            os.close(reader)
        for victim in victims:
            if victim.read_bytes() != PRECIOUS:
                raise RuntimeError(f"{victim} was written over")
        left = [path.name for path in Path(name).rglob(".circlepose-*")]
        if left:
            raise RuntimeError(f"left behind: {left}")
        return outcome


def _one_sentence(message: str) -> str:
    if not message.strip() or "Traceback" in message or "bug" in message:
        raise RuntimeError(f"no sentence: {message}")
    return "refused"
