"""Where things are in the checkout and in the site's sources."""

from __future__ import annotations

from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
GENERATED = DOCS / "generated"
"""Pages and pictures that the build makes; git ignores them."""


def write(name: str, text: str) -> None:
    """Write a generated page."""
    path = GENERATED / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
