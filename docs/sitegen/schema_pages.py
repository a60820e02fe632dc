"""The JSON Schemas of all outputs, as the package ships them: a page each, and the files themselves."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import circlepose
from sitegen.paths import write

INTRODUCTION = """# JSON Schemas of what is written

Every JSON that circlepose writes names its schema in the key `schema`, such as `circlepose.poses/1`. The schemas are
shipped with the package, in `circlepose/schemas/`.

"""


def schema_files() -> list[Path]:
    """Return the schemas of the installed package; none where it has no such folder."""
    return sorted((Path(circlepose.__file__).parent / "schemas").glob("*.json"))


def write_pages() -> None:
    """Write a page for each schema and one that lists them."""
    files = schema_files()
    text = INTRODUCTION + ("" if files else "This version ships none.\n")
    for path in files:
        schema = json.loads(path.read_text(encoding="utf-8"))
        write(f"schemas/{path.name}", path.read_text(encoding="utf-8"))
        write(f"schemas/{path.stem}.md", page(path.name, schema))
    if files:
        text += "```{toctree}\n:maxdepth: 1\n\n" + "\n".join(path.stem for path in files) + "\n```\n"
    write("schemas/index.md", text)


def page(file_name: str, schema: dict[str, Any]) -> str:
    """Return the page of one schema: its keys with their types and meaning, then its text."""
    parts = [f"# {schema.get('title', Path(file_name).stem)}\n"]
    if "description" in schema:
        parts.append(schema["description"] + "\n")
    parts.append(f"File: {{download}}`{file_name} <{file_name}>`\n")
    for title, node in tables(schema):
        parts.append(f"## {title}\n" if title else "")
        if title and "description" in node:
            parts.append(node["description"] + "\n")
        others = [type_name(each) for each in (node, *node.get("allOf", [])) if "$ref" in each]
        parts.append(f"All keys of {' and '.join(others)}, and:\n" if others else "")
        parts.append(table(node))
    parts.append(f"## The schema\n\n```{{literalinclude}} {file_name}\n:language: json\n```\n")
    return "\n".join(parts)


def tables(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield a title and an object with keys: the document, then each definition."""
    if "properties" in schema:
        yield "", schema
    for name, node in {**schema.get("definitions", {}), **schema.get("$defs", {})}.items():
        if "properties" in node:
            yield name, node


def table(node: dict[str, Any], prefix: str = "") -> str:
    """Return the keys of an object as a table; keys of objects within it follow theirs, with a dot."""
    return "\n".join(["| key | type | meaning |", "|---|---|---|", *_rows(node, prefix)]) + "\n"


def _rows(node: dict[str, Any], prefix: str) -> Iterator[str]:
    for key, value in node.get("properties", {}).items():
        words = str(value.get("description", "")).split() if isinstance(value, dict) else []
        if key not in node.get("required", []):
            words.append("(may be absent)")
        meaning = " ".join(words).replace("|", r"\|")
        yield f"| `{prefix}{key}` | {type_name(value)} | {meaning} |"
        items = value.get("items") if isinstance(value, dict) else None
        if isinstance(items, dict):
            yield from _rows(items, f"{prefix}{key}[].")
        elif isinstance(value, dict):
            yield from _rows(value, f"{prefix}{key}.")


def type_name(value: object) -> str:
    """Return in short what a value of a schema may be."""
    if not isinstance(value, dict):
        return "any"
    if "$ref" in value:
        return str(value["$ref"]).rsplit("/", maxsplit=1)[-1]
    if "const" in value:
        return f"`{json.dumps(value['const'])}`"
    if "enum" in value:
        return ", ".join(f"`{json.dumps(each)}`" for each in value["enum"]).replace("|", r"\|")
    for several in ("anyOf", "oneOf"):
        if several in value:
            return " or ".join(dict.fromkeys(type_name(each) for each in value[several]))
    kinds = value.get("type", "any")
    name = " or ".join(kinds) if isinstance(kinds, list) else str(kinds)
    return f"{name} of {type_name(value['items'])}" if "items" in value else name
