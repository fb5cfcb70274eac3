"""Hooks of MkDocs: generated pages, links of the repository, formulas.

Pages under docs/ link to files of the repository where these stand in it, so that they
can be read there; on the site a link leads to the page that the file became.
"""

from collections.abc import Iterator

# MkDocs is there where the manual is built: `make docs`
from mkdocs.config.defaults import (  # type: ignore
    MkDocsConfig,
)
from mkdocs.structure.files import (  # type: ignore
    File,
    Files,
)
from mkdocs.structure.pages import Page  # type: ignore

from docs.generate import blocks, pages
from docs.generate.links import to_site
from docs.generate.mathml import with_mathml

PAGES = pages.generated()


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Fill the sections of the navigation that are generated."""
    for title, entries in pages.navigation(PAGES).items():
        _section(config["nav"], title).extend(entries)
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, and the files of the repository that pages show."""
    for page in PAGES:
        files.append(File.generated(config, page.uri, content=page.text()))
    for uri, path in pages.shown().items():
        files.append(File.generated(config, uri, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, **_) -> str:
    """Put generated blocks in, and turn links of the repository into links of the site.

    The order matters: blocks are written with links of the site.
    """
    uri = page.file.src_uri
    source = next((p.source for p in PAGES if p.uri == uri), f"docs/{uri}")
    return blocks.filled(to_site(markdown, source, uri))


def on_page_content(html: str, **_) -> str:
    """Write formulas as MathML, which browsers draw by themselves."""
    return with_mathml(html)


def _section(nav: list, title: str) -> list:
    """Return the list of a section, at whatever depth it stands."""
    (found,) = _sections(nav, title)
    return found


def _sections(nav: list, title: str) -> Iterator[list]:
    for entry in nav:
        for name, children in entry.items() if isinstance(entry, dict) else ():
            if name == title:
                yield children
            elif isinstance(children, list):
                yield from _sections(children, title)
