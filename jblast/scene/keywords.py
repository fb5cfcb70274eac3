"""Keywords of what a scene is made of: those of the scene file, others refused."""

from dataclasses import fields
from typing import Any

import equinox as eqx

from jblast.errors import nearest


class Described(eqx.Module):
    """A part of a scene, made by the keywords that its table of the file has."""

    def __new__(cls, *values: Any, **named: Any):
        """Refuse a keyword that is no attribute, and name those that are.

        Raises:
            TypeError: As Python's, which does not say what would have been right.
        """
        known = [field.name for field in fields(cls)]
        for keyword in named:
            if keyword not in known:
                raise TypeError(
                    f"{cls.__name__}: no keyword {keyword!r}{nearest(keyword, known)}; "
                    f"expected one of {', '.join(known)}"
                )
        return super().__new__(cls)
