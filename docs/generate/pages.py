"""Generated pages: tutorials, API, results, schemas, pages of the root."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from docs.generate import api, documents, notebooks, results, scene_schema
from docs.generate.front_door import front_door

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


@dataclass(frozen=True)
class Generated:
    """A page, or another text, that no file under docs/ holds.

    Attributes:
        uri: Where it stands on the site.
        source: The file of the repository it is made from: its links start there.
        title: What the navigation calls it.
        section: Of the navigation; "" where mkdocs.yml names the page itself.
        text: Writes it.
    """

    uri: str
    source: str
    title: str
    section: str
    text: Callable[[], str]


def generated() -> list[Generated]:
    """Return all generated pages, in the order of the navigation."""
    return [
        *(
            Generated(f"tutorials/{path.stem}.md", f"notebooks/{path.name}",
                      notebooks.title(path), "Tutorials",
                      lambda path=path: notebooks.page(path))
            for path in notebooks.all_of_them(ROOT)
        ),
        Generated("reference/api/index.md", "docs/reference/api/index.md", "API", "API",
                  lambda: api.tree(ROOT)),
        *(
            Generated(uri, room.source, room.name, "API",
                      lambda room=room: api.page(room) if "." in room.name
                      else front_door(ROOT, room))
            for room in api.rooms(ROOT)
            for uri in [f"reference/api/{room.name}.md"]
        ),
        Generated("results/index.md", "calibration/results/index.md", "Results",
                  "Results", lambda: results.index(ROOT)),
        *(
            Generated(result.uri, result.source, result.title, "Results",
                      lambda result=result: results.page(result))
            for result in results.all_of_them(ROOT)
        ),
        *(
            Generated(uri, source, "", "",
                      lambda source=source: (ROOT / source).read_text("utf-8"))
            for uri, source in ALSO.items()
        ),
        *(
            Generated(f"reference/schemas/{name}.json", "", "", "",
                      lambda schema=schema: json.dumps(schema(), indent=1) + "\n")
            for name, schema in SCHEMAS.items()
        ),
    ]  # fmt: skip


def navigation(pages: list[Generated]) -> dict[str, list[dict[str, str] | str]]:
    """Return the entries of each section that generated pages fill."""
    sections: dict[str, list[dict[str, str] | str]] = {}
    for page in pages:
        if page.section:
            entry = (
                page.uri if page.uri.endswith("index.md") else {page.title: page.uri}
            )
            sections.setdefault(page.section, []).append(entry)
    return sections


def shown() -> dict[str, Path]:
    """Return every other file that the site holds: pictures, notebooks, schemas."""
    kept = ROOT / "calibration" / "results"
    files = {
        f"results/{path.relative_to(kept).as_posix()}": path
        for pattern in ("*.png", "*.csv")
        for path in sorted(kept.rglob(pattern))
    }
    return files | {
        f"tutorials/{path.name}": path for path in notebooks.all_of_them(ROOT)
    }
