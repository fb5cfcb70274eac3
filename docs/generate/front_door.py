"""The names at the package's root, each with the package that documents it."""

import ast
from dataclasses import replace
from pathlib import Path

from docs.generate.api import Room, page, rooms


def front_door(root: Path, front: Room) -> str:
    """Write the page of the package itself; also names of no package."""
    homes = {
        (name, module): f"{room.name}.md"
        for room in rooms(root)
        if room.name != front.name
        for name, module in room.offers.items()
    }
    rows, own = [], {}
    for name, module in sorted(front.offers.items()):
        there = homes.get((name, module), "")
        if not there:
            own[name] = module
        link = f"[`{name}`]({there}#{module}.{name})"
        rows.append(f"| {link} | {_summary(root, module, name)} |")
    head, *rest = page(replace(front, offers=own)).split("\n\n:::", maxsplit=1)
    table = "\n".join(["| name | |", "|---|---|", *rows])
    return "\n\n".join([head, table, *(f":::{entry}" for entry in rest)]) + "\n"


def _summary(root: Path, module: str, name: str) -> str:
    """Return the first line of the docstring of a function or a class."""
    source = root.joinpath(*module.split(".")).with_suffix(".py")
    for node in ast.parse(source.read_text("utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""
