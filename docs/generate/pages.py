"""Generated pages: tutorials, API, results, schemas, pages of the root."""

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

from docs.generate import api, documents, notebooks, results, scene_schema

ROOT = Path(__file__).parents[2]
ALSO = {
    "index.md": "README.md",
    "changelog.md": "CHANGELOG.md",
    "contributing.md": "CONTRIBUTING.md",
}
"""Pages that are files of the repository's root."""
SCHEMAS = {
    "scene": scene_schema.scene_schema,
    **{name: partial(documents.schema, name) for name in documents.DOCUMENTS},
}
"""JSON Schemas, by name."""


class Generated(NamedTuple):
    """A page, or another text, that no file under docs/ holds.

    Attributes:
        uri: Position on the site.
        source: File of the repository from which it is made: its links start there.
        text: Function that returns its content.
        title: Name in the navigation.
        section: Section of the navigation; "" if mkdocs.yml names the page itself.
    """

    uri: str
    source: str
    text: Callable[[], str]
    title: str = ""
    section: str = ""


def generated() -> list[Generated]:
    """Return all generated pages, in the order of the navigation."""
    return list(_generated())


def _generated() -> Iterator[Generated]:
    for path in notebooks.all_of_them(ROOT):
        uri, text = f"tutorials/{path.stem}.md", partial(notebooks.page, path)
        title = notebooks.title(path)
        yield Generated(uri, f"notebooks/{path.name}", text, title, "Tutorials")
    uri, tree = "reference/api/index.md", partial(api.tree, ROOT)
    yield Generated(uri, f"docs/{uri}", tree, "API", "API")
    for room in api.rooms(ROOT):
        uri, text = f"reference/api/{room.name}.md", partial(api.page, ROOT, room)
        yield Generated(uri, room.source, text, room.name, "API")
    uri, index = "results/index.md", partial(results.index, ROOT)
    yield Generated(uri, f"{results.KEPT}/index.md", index, "Results", "Results")
    for path in results.all_of_them(ROOT):
        uri, text = f"results/{path.stem}.md", partial(results.page, ROOT, path)
        source, title = path.relative_to(ROOT).as_posix(), results.title(path)
        yield Generated(uri, source, text, title, "Results")
    for uri, source in ALSO.items():
        yield Generated(uri, source, partial((ROOT / source).read_text, "utf-8"))
    for name, schema in SCHEMAS.items():
        text = partial(lambda schema: json.dumps(schema(), indent=1) + "\n", schema)
        yield Generated(f"reference/schemas/{name}.json", "", text)


def navigation(pages: list[Generated]) -> dict[str, list[dict[str, str] | str]]:
    """Return the entries of each section that generated pages fill."""
    sections: dict[str, list[dict[str, str] | str]] = {}
    for page in pages:
        if page.section:
            # the index of a section has its title
            entry = page.uri if page.title == page.section else {page.title: page.uri}
            sections.setdefault(page.section, []).append(entry)
    return sections


def shown() -> dict[str, Path]:
    """Return every other file of the site: pictures, tables, notebooks."""
    kept = ROOT / results.KEPT
    files = [*sorted(kept.rglob("*.png")), *sorted(kept.rglob("*.csv"))]
    return {f"results/{path.relative_to(kept).as_posix()}": path for path in files} | {
        f"tutorials/{path.name}": path for path in notebooks.all_of_them(ROOT)
    }
