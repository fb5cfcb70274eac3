"""The page of a view: one template, self-contained, without scripts."""

import base64
import io
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from PIL import Image

import jblast
from jblast.report.provenance import provenance_lines
from jblast.report.view import Block, Facts, Lines, Picture, Table, Text, View


def page(view: View, drawn: Mapping[str, bytes]) -> str:
    """Return a view as a page.

    Args:
        view: The view.
        drawn: PNG files of its figures by name; figures without one are left out.
    """
    environment = Environment(
        # names from logs and scenes are escaped: they could contain markup
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        loader=FunctionLoader(_read),
    )
    blocks = view.of("everywhere", "page", "detail")
    shown = [b for b in blocks if not isinstance(b, Picture) or b.name in drawn]
    return environment.get_template("page.html").render(
        view=view,
        blocks=[_values(block, drawn) for block in shown],
        provenance=provenance_lines(view.made) if view.made else [],
        scene=view.made.scene_text if view.made else "",
        version=jblast.__version__,
    )


def _values(block: Block, drawn: Mapping[str, bytes]) -> dict[str, Any]:
    """Return what the template needs of a block."""
    values: dict[str, Any] = {"kind": type(block).__name__, "title": block.title}
    if isinstance(block, Table):
        kept = block.kept()
        cells = zip(*(column for _, column in kept), strict=True)
        values |= {
            "columns": [column for column, _ in kept],
            "headed": any(column.head for column, _ in kept),
            "rows": [
                {"cells": of, "marked": block.marked(row), "note": block.note(row)}
                for row, of in zip(block.shown, cells, strict=bool(kept))
            ],
            "left_out": block.left_out,
            "caption": block.caption,
        }
    elif isinstance(block, Facts):
        values["facts"] = block.shown
    elif isinstance(block, Lines):
        values["lines"] = block.shown
    elif isinstance(block, Text):
        values["text"] = block.text
    else:
        png = drawn[block.name]
        with Image.open(io.BytesIO(png)) as image:
            # 96 pixels of CSS are an inch
            width = round(96 * image.width / image.info["dpi"][0])
        source = f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"
        values |= {"source": source, "width": width}
        values |= {"alt": block.alt, "caption": block.caption}
    return values


def _read(name: str) -> str:
    return files("jblast.report").joinpath(name).read_text("utf-8")
