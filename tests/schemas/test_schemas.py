"""The schemas are valid, say what each key means, agree with the program, and refuse what is not an output."""

from __future__ import annotations

import copy
import io
import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from circlepose import schemas
from circlepose.errors import ArgumentError
from circlepose.evaluation.compare import CHANGE_MEANING
from circlepose.geometry.cone import ConeKind
from circlepose.io.tables import LAYOUTS
from circlepose.io.tables.paper_layouts import write_results
from circlepose.results import Flag, ImageResult, SettledBy, Status
from circlepose.solvers import METHODS
from circlepose.studies.gcc import PARTS
from circlepose.studies.published import TABLES_1_AND_2
from circlepose.studies.scenes import cd_scenes
from circlepose_cli.app import main
from tests.support.board_results import board_folder, made_board, made_board_result
from tests.support.discs import disc_folder, made_circle, made_result
from tests.support.json_outputs import check_captured, documents, faults
from tests.support.paths import ROOT

NAMES = schemas.names()
SAMPLES = ROOT / "sample_images"
COMMANDS = {
    "circlepose.poses/1": ["estimate", "-q", "{imgs}", "--camera-sigma", "1,1", "--format", "json"],
    "circlepose.boards/1": ["estimate", "-q", "{boards}", "--camera-sigma", "1,1", "--format", "json"],
    "circlepose.pairs/1": ["estimate", "-q", "{boards}", "--layout", "pairs", "--format", "json"],
    "circlepose.table1/1": ["estimate", "-q", "{imgs}", "--method", "all", "--layout", "table1", "--format", "json"],
    "circlepose.table2/1": [
        "estimate",
        "-q",
        "{imgs}",
        "--layout",
        "table2",
        "--reference",
        "{poses}",
        "--format",
        "json",
    ],
    "circlepose.check/1": [
        "check",
        "-q",
        "{poses}",
        "--against",
        "{moved}",
        "--position-mm",
        "1e-9",
        "--format",
        "json",
    ],
    "circlepose.explain/1": ["explain", "-q", "{ring}", "--radius-sigma-mm", "0.1", "--format", "json"],
    "circlepose.inspection/1": ["inspect", "{ring}", "--format", "json"],
    "circlepose.camera/1": ["camera", "{camera}", "--format", "json"],
    "circlepose.plan/1": [
        "plan",
        "--calib",
        "{imgs}/camera.yaml",
        "--target",
        "{imgs}/target.yaml",
        "--distance-mm",
        "200",
        "--tilt-deg",
        "30",
        "--format",
        "json",
    ],
    "circlepose.study.gcc/1": ["study", "gcc", "--scenes", "1", "--format", "json"],
    "circlepose.study.noise/1": ["study", "noise", "--repeats", "2", "--format", "json"],
    "circlepose.study.table1/1": ["study", "table1", "--format", "json"],
    "circlepose.study.table2/1": ["study", "table2", "--format", "json"],
}


def objects(schema: Any) -> Iterator[dict[str, Any]]:
    """Yield every schema within a schema."""
    if isinstance(schema, dict):
        yield schema
        for key, value in schema.items():
            within = value.values() if key in ("properties", "$defs") else [value]
            for each in within:
                yield from objects(each)
    elif isinstance(schema, list):
        for each in schema:
            yield from objects(each)


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """A document of each schema, as the program prints it."""
    folder = tmp_path_factory.mktemp("schemas")
    places = {
        "imgs": disc_folder(folder / "imgs"),
        "boards": board_folder(folder / "boards", 1),
        "poses": folder / "poses.csv",
        "moved": folder / "moved.csv",
        "ring": SAMPLES / "coaxial" / "a.png",
        "camera": SAMPLES / "cd" / "camera.yml",
    }
    assert main(["estimate", "-q", str(places["imgs"]), "-o", str(places["poses"])]) == 0
    assert main(["estimate", "-q", "--no-refine", str(places["imgs"]), "-o", str(places["moved"])]) == 0
    made: dict[str, Any] = {}
    for name, args in COMMANDS.items():
        out = folder / "out"
        with pytest.MonkeyPatch.context() as patch, out.open("w+") as handle:
            patch.setattr("sys.stdout", handle)
            # One scene of each study is enough.
            patch.setattr("circlepose.studies.table1.cd_scenes", lambda: cd_scenes()[:1])
            patch.setattr("circlepose.studies.table2.TABLES_1_AND_2", TABLES_1_AND_2[:1])
            patch.setattr("circlepose.studies.gcc.PARTS", PARTS[:1])
            assert main([each.format(**places) for each in args]) in (0, 4)
        made[name] = json.loads(out.read_text())
    return made


@pytest.mark.parametrize("name", NAMES)
def test_a_schema_is_valid_and_is_that_of_its_name(name):
    schema = schemas.schema(name)
    Draft202012Validator.check_schema(schema)
    assert schema["$id"].endswith(f"/circlepose/schemas/{name.removeprefix('circlepose.').replace('/', '-')}.json")
    known = [
        each["properties"]["schema"]["const"] for each in objects(schema) if "schema" in each.get("properties", {})
    ]
    assert set(known) == {name}


@pytest.mark.parametrize("name", NAMES)
def test_every_key_is_described(name):
    found = list(objects(schemas.schema(name)))
    bare = [
        key for each in found for key, value in each.get("properties", {}).items() if not value.get("description")
    ]
    assert bare == []
    assert all(each.get("description") for each in schemas.schema(name)["$defs"].values() if "properties" in each)


@pytest.mark.parametrize("name", NAMES)
def test_units_are_named(name):
    units = {"mm": "mm", "px": "px", "deg": "deg", "(mm)": "mm", "(px)": "px", "(deg)": "deg"}
    for each in objects(schemas.schema(name)):
        for key, value in each.get("properties", {}).items():
            unit = units.get(key.replace(" ", "_").split("_")[-1])
            description = value["description"]
            is_short = description.startswith("see ") or value.get("type") == "object"
            assert unit is None or is_short or unit in description, key


def test_every_id_in_the_program_has_a_schema():
    source = "".join(
        path.read_text(encoding="utf-8") for top in ("circlepose", "cli") for path in (ROOT / top).rglob("*.py")
    )
    literal = {part.split('"')[0] for part in source.split('"circlepose.')[1:] if part.split('"')[0].endswith("/1")}
    written = {f"circlepose.{name}" for name in literal if "{" not in name}
    sheets = ("circlepose.table", "circlepose.study.", "circlepose.plan/")
    assert written == {name for name in NAMES if not name.startswith(sheets)}
    assert {f"circlepose.{layout}/1" for layout in LAYOUTS} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_an_output_is_as_its_schema_says(outputs, name):
    assert outputs[name]["schema"] == name
    assert faults(outputs[name]) == []


def changed(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], str]]:
    """Yield what to change in a document, one change for each key at each depth: only the first of equal entries."""
    if isinstance(value, dict):
        for key, entry in value.items():
            yield (*path, key), "missing"
            if isinstance(entry, float) or (isinstance(entry, int) and not isinstance(entry, bool)):
                yield (*path, key), "text"
            yield from changed(entry, (*path, key))
        yield path, "extra"
    elif isinstance(value, list) and value:
        yield from changed(value[0], (*path, 0))


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_document_is_refused(outputs, name):
    tried = 0
    for path, change in changed(outputs[name]):
        if "rejected" in path:
            continue  # counts by reason, whose keys are words
        document = copy.deepcopy(outputs[name])
        parent: Any = document
        for key in path if change == "extra" else path[:-1]:
            parent = parent[key]
        if change == "missing":
            del parent[path[-1]]
        elif change == "text":
            parent[path[-1]] = str(parent[path[-1]])
        else:
            parent["colour"] = 1
        if path == ("schema",) and change == "missing":
            assert not Draft202012Validator(schemas.schema(name)).is_valid(document)
        else:
            assert faults(document), (path, change)
        tried += 1
    assert tried > 10


def test_choices_are_those_of_the_program():
    definitions = schemas.schema("poses")["$defs"]
    circle = definitions["circle"]["properties"]
    assert definitions["status"]["enum"] == list(Status)
    assert circle["flags"]["items"]["enum"] == list(Flag)
    assert schemas.schema("boards")["$defs"]["board"]["properties"]["flags"] == circle["flags"]
    assert circle["settled_by"]["enum"] == [*SettledBy, None]
    assert circle["cone"]["enum"] == [*ConeKind, None]
    assert circle["method"]["enum"] == list(METHODS)
    assert schemas.schema("table1")["$defs"]["row"]["properties"]["Method"]["enum"] == [*METHODS, None]
    assert schemas.schema("check")["$defs"]["difference"]["properties"]["change"]["enum"] == list(CHANGE_MEANING)


def test_what_several_schemas_define_is_the_same():
    seen: dict[str, Any] = {}
    own = {"document", "line", "row"}
    for name in NAMES:
        for key, definition in schemas.schema(name)["$defs"].items():
            assert key in own or seen.setdefault(key, definition) == definition, (name, key)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("data_format", ["json", "jsonl"])
def test_failures_are_as_the_schema_says(layout, data_format):
    failed = [
        ImageResult("\udce9.png", status, "why", image_size=None) for status in Status if status is not Status.OK
    ]
    unmeasured = replace(made_circle(), status=Status.NO_POSE, candidates=(), reason="why", cone=None, ellipse=None)
    handle = io.StringIO()
    some = [
        made_board_result(made_board(), made_board(1, ())),
        replace(made_board_result(), status=Status.TOO_FEW_CIRCLES),
    ]
    results = [*failed, *some, made_result(unmeasured, image="b.png"), made_result(made_circle(), image="a.png")]
    write_results(results, handle, data_format=data_format, layout=layout)
    found = documents(handle.getvalue())
    assert len(found) == (1 if data_format == "json" else len(handle.getvalue().splitlines()))
    assert [each for document in found for each in faults(document)] == []


def test_the_check_of_all_outputs_finds_a_wrong_one(capsys):
    with pytest.MonkeyPatch.context() as patch:
        check_captured(patch)
        print('{"schema": "circlepose.poses/1", "version": "1", "images": []}')
        assert capsys.readouterr().out
        print('{"schema": "circlepose.poses/1", "images": []}')
        with pytest.raises(AssertionError, match="'version' is a required property"):
            capsys.readouterr()


def test_the_command_prints_the_schemas(capsys):
    assert main(["schema"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(NAMES)
    for name in ("poses", "circlepose.poses/1"):
        assert main(["schema", name]) == 0
        assert json.loads(capsys.readouterr().out) == schemas.schema("poses")


@pytest.mark.parametrize("name", ["nope", "", "../poses", "poses-1.json", "é\n"])
def test_a_name_without_a_schema_ends_with_a_sentence(capsys, name):
    assert main(["schema", name]) == 2
    assert "no schema has this name; expected one of boards, camera, check," in capsys.readouterr().err
    with pytest.raises(ArgumentError, match="no schema has this name"):
        schemas.schema(name)
