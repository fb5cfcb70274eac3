"""Links: where a file of the repository stands on the site."""

import posixpath
import re

LINK = re.compile(r"(\]\()([^)\s]+)(\))")
RENAMED = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
FOLDERS = {
    "docs/": "",
    "calibration/results/": "results/",
    "notebooks/": "tutorials/",
}
"""Folders of the repository whose files became pages, and where."""


def site_uri(path: str) -> str | None:
    """Return where a file of the repository stands on the site; None if nowhere."""
    if path in RENAMED:
        return RENAMED[path]
    for folder, to in FOLDERS.items():
        if path.startswith(folder):
            uri = to + path.removeprefix(folder)
            return re.sub(r"\.(txt|ipynb)$", ".md", uri)
    return None


def targets(markdown: str) -> list[str]:
    """Return the targets of all links and pictures, without what stands elsewhere."""
    found = [match[2] for match in LINK.finditer(without_code(markdown))]
    return [link for link in found if "://" not in link and not link.startswith("#")]


def without_code(markdown: str) -> str:
    """Return a page without its code, in which brackets are no links."""
    fenced = re.sub(r"^```.*?^```", "", markdown, flags=re.M | re.S)
    return re.sub(r"`[^`\n]*`", "", fenced)


def in_repository(link: str, source: str) -> str:
    """Return the file of the repository that a link of a file leads to."""
    path = link.partition("#")[0]
    return posixpath.normpath(posixpath.join(posixpath.dirname(source), path))


def to_site(markdown: str, source: str, uri: str) -> str:
    """Turn the links of a file of the repository into links of a page.

    Args:
        markdown: The text.
        source: Where the file stands in the repository.
        uri: Where the page stands on the site.
    """
    here = posixpath.dirname(uri)

    def turned(match: re.Match[str]) -> str:
        link = match[2]
        if "://" in link or link.startswith("#"):
            return match[0]
        there = site_uri(in_repository(link, source))
        if there is None:
            return match[0]  # MkDocs names it
        _, hash_, anchor = link.partition("#")
        relative = posixpath.relpath(there, here or ".")
        return f"{match[1]}{relative}{hash_}{anchor}{match[3]}"

    return LINK.sub(turned, markdown)
