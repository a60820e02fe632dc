"""All that is made before Sphinx reads the pages."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor

from sitegen import api_pages, cli_pages, copies, gallery, notebooks, pictures, schema_pages
from sitegen.paths import GENERATED


def write_all() -> None:
    """Make the generated pages and pictures, none of which remains from before."""
    shutil.rmtree(GENERATED, ignore_errors=True)
    parts = [part.write_pages for part in (notebooks, gallery, cli_pages, copies, api_pages, schema_pages)]
    # Most of it is other processes' work.
    with ThreadPoolExecutor(2) as threads:
        running = [threads.submit(part) for part in (*parts, lambda: pictures.write_pictures(GENERATED / "pictures"))]
    for part in running:
        part.result()
