"""The notebooks, run from the first cell to the last; and as pages, with what their cells show."""

from __future__ import annotations

import base64
import logging
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

from sitegen.links import for_site
from sitegen.paths import DOCS, GENERATED, ROOT, write

logging.getLogger("traitlets").setLevel(logging.WARNING)
NOTEBOOKS = DOCS / "notebooks"
CELL_TIMEOUT_S = 300


def executed(path: Path) -> Any:
    """Return a notebook with the outputs of its cells; raises `CellExecutionError` at the first that fails."""
    notebook = nbformat.read(path, as_version=4)
    where = {"metadata": {"path": str(path.parent)}}
    return NotebookClient(notebook, timeout=CELL_TIMEOUT_S, kernel_name="python3", resources=where).execute()


def write_pages() -> None:
    """Run each notebook and write it as a page, with its pictures."""
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        name = path.relative_to(ROOT).as_posix()
        parts = [for_site(part, name) for part in page(executed(path), path.stem)]
        parts.insert(
            1, f"The notebook is [{path.name}](https://github.com/circlepose/circlepose/blob/main/{name}).\n"
        )
        write(f"notebooks/{path.stem}.md", "\n".join(parts))


def page(notebook: Any, stem: str) -> list[str]:
    """Return the cells as Markdown, each code cell followed by its outputs."""
    parts = []
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type != "code":
            parts.append(cell.source + "\n")
            continue
        parts.append(f"```python\n{cell.source}\n```\n")
        parts += [shown(output, f"{stem}-{number}") for output in cell.outputs]
    return parts


def shown(output: Any, name: str) -> str:
    """Return one output as Markdown: a picture, a table or text."""
    if output.output_type == "stream":
        return f"```text\n{output.text.rstrip()}\n```\n"
    data = output.get("data", {})
    if "image/png" in data:
        picture = GENERATED / "notebooks" / f"{name}.png"
        picture.parent.mkdir(parents=True, exist_ok=True)
        picture.write_bytes(base64.b64decode(data["image/png"]))
        return f"![output]({picture.name})\n"
    if "text/html" in data:
        return f"```{{raw}} html\n{data['text/html']}\n```\n"
    return f"```text\n{data['text/plain']}\n```\n"
