"""What a class's docstring says of its attributes."""

import re
from inspect import cleandoc


def attributes(docstring: str) -> dict[str, str]:
    """Return the entries of the section "Attributes" of a docstring, by name."""
    _, _, section = cleandoc(docstring).partition("\nAttributes:\n")
    found: dict[str, str] = {}
    name = ""
    for line in section.splitlines():
        entry = re.match(r"    (\w+): (.*)", line)
        if entry:
            name = entry[1]
            found[name] = entry[2]
        elif line.startswith("        ") and name:
            found[name] += f" {line.strip()}"
        elif line and not line.startswith(" "):
            break
    return found
