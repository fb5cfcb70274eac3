"""Keywords of what a scene is made of: those of the scene file, others refused."""

from dataclasses import fields
from typing import Any

import equinox as eqx

from jblast.errors import nearest, shown


class Described(eqx.Module):
    """A part of a scene, made by the keywords that its table of the file has."""

    def __new__(cls, *values: Any, **named: Any):
        """Refuse a keyword that is no attribute, and text in place of a number.

        Raises:
            TypeError: As Python's, which does not say what would have been right, and
                as JAX's, which does not say of what.
        """
        known = [field.name for field in fields(cls)]
        for keyword in named:
            if keyword not in known:
                raise TypeError(
                    f"{cls.__name__}: no keyword {keyword!r}{nearest(keyword, known)}; "
                    f"expected one of {', '.join(known)}"
                )
        words = {one.name for one in fields(cls) if one.metadata.get("static")}
        for keyword, value in (*zip(known, values, strict=False), *named.items()):
            if isinstance(value, str) and keyword not in words:
                raise TypeError(
                    f"{cls.__name__} {keyword}: expected a number or numbers, got "
                    f"{shown(value)}"
                )
        return super().__new__(cls)
