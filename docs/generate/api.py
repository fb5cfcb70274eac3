"""The API, a page a room: the exported names with their docstrings."""

import ast
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Room:
    """A package of ours that offers names.

    Attributes:
        name: As it is imported.
        source: Its `__init__.py` in the repository.
        about: Its docstring.
        offers: By name, the module that defines it.
    """

    name: str
    source: str
    about: str
    offers: dict[str, str]


def rooms(root: Path) -> list[Room]:
    """Return the packages that offer anything, in the order in which they are read."""
    found = [
        _room(path, root) for path in sorted((root / "jblast").rglob("__init__.py"))
    ]
    return sorted((room for room in found if room.offers), key=lambda room: room.name)


def page(room: Room) -> str:
    """Return the page of a package, module by module, with formulas and sources."""
    modules: dict[str, list[str]] = {}
    for name, module in room.offers.items():
        modules.setdefault(module, []).append(name)
    entries = [
        f"::: {module}\n    options:\n      members: [{', '.join(names)}]\n"
        f"      heading: {title}\n      toc_label: {title}"
        for module, names in modules.items()
        for title in [module.removeprefix(f"{room.name}.")]
    ]
    return "\n\n".join([f"# {room.name}", room.about, *entries]) + "\n"


def tree(root: Path) -> str:
    """Return the list of all packages, each with the first line of its docstring."""
    lines = []
    offering = {room.name for room in rooms(root)}
    for path in sorted((root / "jblast").rglob("__init__.py")):
        parts = path.parent.relative_to(root).parts
        name = ".".join(parts)
        about = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
        shown = f"[`{name}`]({name}.md)" if name in offering else f"`{name}`"
        indent = "    " * (len(parts) - 1)
        lines.append(f"{indent}- {shown}: {about.partition(chr(10))[0]}")
    head = (
        "# API\n\nImport a name from the package of its page: "
        "`from jblast.waves import scaled_distance`.\n\n## Packages\n\n"
    )
    return head + "\n".join(lines) + "\n"


def _room(path: Path, root: Path) -> Room:
    name = ".".join(path.parent.relative_to(root).parts)
    tree = ast.parse(path.read_text("utf-8"))
    offers = {
        offer: _home(root, offer, module)
        for offer, module in _re_exported(tree).items()
        if module != name  # a module of the room's own
    }
    about = ast.get_docstring(tree) or ""
    return Room(name, path.relative_to(root).as_posix(), about, offers)


def _home(root: Path, name: str, module: str) -> str:
    """Return the module that defines a name, where its room has it from another room.

    A face may offer a function that is called as its module is.
    """
    face = root.joinpath(*module.split("."), "__init__.py")
    if not face.exists():
        return module
    further = _re_exported(ast.parse(face.read_text("utf-8"))).get(name, module)
    return module if further == module else _home(root, name, further)


def _re_exported(tree: ast.Module) -> dict[str, str]:
    """Return names that are imported as themselves: those that a face offers."""
    return {
        name.name: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for name in node.names
        if name.asname == name.name
    }
