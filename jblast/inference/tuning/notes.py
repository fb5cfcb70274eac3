"""What to know of an answer, to be worded where it is printed."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

Kind = Literal[
    "reading",
    "noise_added",
    "blast_outside",
    "law_invalid",
    "thinned",
]


class Note(NamedTuple):
    """Something to know.

    Attributes:
        kind: What it is about.
        about: Its numbers and names.
    """

    kind: Kind
    about: Mapping[str, Any]
