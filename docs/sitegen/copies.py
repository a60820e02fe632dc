"""Pages that lie elsewhere in the repository: the benchmarks' figures and the changelog."""

from __future__ import annotations

from sitegen.links import for_site
from sitegen.paths import ROOT, write


def write_pages() -> None:
    """Write them, with a table of contents below the first."""
    results = sorted((ROOT / "benchmarks" / "results").glob("*.md"))
    for path in (ROOT / "benchmarks" / "README.md", *results, ROOT / "CHANGELOG.md"):
        name = path.relative_to(ROOT).as_posix()
        text = for_site(path.read_text(encoding="utf-8"), name)
        if path.name == "README.md":
            text += "\n```{toctree}\n:hidden:\n\n" + "".join(f"results/{each.stem}\n" for each in results) + "```\n"
        write("changelog.md" if path.name == "CHANGELOG.md" else name, text)
