"""The API, a page for each package: the exported names with their docstrings."""

import ast
from pathlib import Path
from typing import NamedTuple

FRONT = "jblast"


class Room(NamedTuple):
    """A package that exports names.

    Attributes:
        name: Its name in imports.
        source: Its `__init__.py` in the repository.
        about: Its docstring.
        offers: By name, the module that defines it.
    """

    name: str
    source: str
    about: str
    offers: dict[str, str]


def rooms(root: Path) -> list[Room]:
    """Return the packages that export names, in alphabetical order."""
    return sorted(room for room in _packages(root) if room.offers)


def page(root: Path, room: Room) -> str:
    """Return the page of a package, module by module, with formulas and sources.

    The page of the package itself lists names of other packages in a table.
    """
    own, rows = dict(room.offers), []
    if room.name == FRONT:
        others = (one for one in rooms(root) if one.name != FRONT)
        homes = {pair: o.name for o in others for pair in o.offers.items()}
        for name, module in sorted(room.offers.items()):
            home = homes.get((name, module), "")
            target = f"{home}.md" if home else ""
            if home:
                del own[name]
            link = f"[`{name}`]({target}#{module}.{name})"
            rows.append(f"| {link} | {_summary(root, module, name)} |")
    modules: dict[str, list[str]] = {}
    for name, module in sorted(own.items()) if rows else own.items():
        modules.setdefault(module, []).append(name)
    entries = [
        f"::: {module}\n    options:\n      members: [{', '.join(names)}]\n"
        f"      heading: {title}\n      toc_label: {title}"
        for module, names in modules.items()
        for title in [module.removeprefix(f"{room.name}.")]
    ]
    table = ["\n".join(["| name | |", "|---|---|", *rows])] if rows else []
    return "\n\n".join([f"# {room.name}", room.about, *table, *entries]) + "\n"


def tree(root: Path) -> str:
    """Return the list of all packages, each with the first line of its docstring."""
    lines = []
    for room in _packages(root):
        shown = f"[`{room.name}`]({room.name}.md)" if room.offers else f"`{room.name}`"
        indent = "    " * room.name.count(".")
        lines.append(f"{indent}- {shown}: {room.about.partition(chr(10))[0]}")
    head = (
        "# API\n\nImport a name from the package of its page: "
        "`from jblast.waves import scaled_distance`.\n\n## Packages\n\n"
    )
    return head + "\n".join(lines) + "\n"


def _packages(root: Path) -> list[Room]:
    found = []
    for path in sorted((root / FRONT).rglob("__init__.py")):
        source = path.relative_to(root)
        name, tree = ".".join(source.parent.parts), ast.parse(path.read_text("utf-8"))
        offers = {
            offer: _home(root, offer, module)
            for offer, module in _re_exported(tree).items()
            if module != name  # a module of the package's own
        }
        about = ast.get_docstring(tree) or ""
        found.append(Room(name, source.as_posix(), about, offers))
    return found


def _home(root: Path, name: str, module: str) -> str:
    """Return the module that defines a name, also if a package re-exports it.

    A package may export a function that has the name of its module.
    """
    face = root.joinpath(*module.split("."), "__init__.py")
    if not face.exists():
        return module
    further = _re_exported(ast.parse(face.read_text("utf-8"))).get(name, module)
    return module if further == module else _home(root, name, further)


def _re_exported(tree: ast.Module) -> dict[str, str]:
    """Return the names that a package exports: imported as themselves."""
    return {
        name.name: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for name in node.names
        if name.asname == name.name
    }


def _summary(root: Path, module: str, name: str) -> str:
    """Return the first line of the docstring of a function or a class."""
    source = root.joinpath(*module.split(".")).with_suffix(".py")
    for node in ast.parse(source.read_text("utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""
