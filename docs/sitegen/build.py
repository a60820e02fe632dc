"""All that is made before Sphinx reads the pages."""

from __future__ import annotations

from sitegen import api_pages, cli_pages, copies, gallery, notebooks, pictures, schema_pages
from sitegen.paths import GENERATED


def write_all() -> None:
    """Make the generated pages and pictures."""
    for part in (copies, cli_pages, api_pages, schema_pages, gallery, notebooks):
        part.write_pages()
    pictures.write_pictures(GENERATED / "pictures")
