"""Makes docs/pictures anew, which README and pages show on GitHub: `python docs/make_pictures.py`."""

from __future__ import annotations

from sitegen.paths import DOCS
from sitegen.pictures import LARGEST_BYTES, write_pictures

for path in write_pictures(DOCS / "pictures"):
    size = path.stat().st_size
    print(f"{path.relative_to(DOCS.parent)}: {size / 1000:.0f} kB")
    if size > LARGEST_BYTES:
        raise SystemExit(f"{path.name}: is over {LARGEST_BYTES / 1000:.0f} kB; render it smaller or with less noise.")
