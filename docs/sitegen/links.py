"""Links that hold on GitHub and on the site: those that leave docs/ lead to the site's copy, or to GitHub."""

from __future__ import annotations

import posixpath
import re

from sitegen.paths import ROOT

REPOSITORY = "https://github.com/circlepose/circlepose"
LINK = re.compile(r"\]\((?![a-z]+:|#)([^)\s#]+)(#[^)\s]*)?\)")
FENCE = re.compile(r"^(```.*?^```)", re.DOTALL | re.MULTILINE)


def site_path(repository_path: str) -> str | None:
    """Return where the site has a file of the repository, as a path below docs/; None where it has not."""
    if repository_path.startswith("docs/pictures/"):
        return "generated/" + repository_path.removeprefix("docs/")
    if repository_path.startswith("docs/") and (ROOT / repository_path).is_file():
        notebook = repository_path.startswith("docs/notebooks/") and repository_path.endswith(".ipynb")
        name = repository_path.removeprefix("docs/")
        return f"generated/{name.removesuffix('.ipynb')}.md" if notebook else name
    if re.fullmatch(r"benchmarks/.*\.md", repository_path):
        return "generated/" + repository_path
    return {"CHANGELOG.md": "generated/changelog.md"}.get(repository_path)


def for_site(text: str, repository_path: str) -> str:
    """Return the text of a page of the repository with its relative links as the site has them."""
    page = site_path(repository_path) or repository_path.removeprefix("docs/")

    def moved(link: re.Match[str]) -> str:
        path, anchor = link[1], link[2] or ""
        target = posixpath.normpath(posixpath.join(posixpath.dirname(repository_path), path))
        place = site_path(target)
        if place is None:
            kind = "tree" if (ROOT / target).is_dir() else "blob"
            return f"]({REPOSITORY}/{kind}/main/{target}{anchor})"
        return f"]({posixpath.relpath(place, posixpath.dirname(page) or '.')}{anchor})"

    parts = FENCE.split(text)
    return "".join(part if part.startswith("```") else LINK.sub(moved, part) for part in parts)
