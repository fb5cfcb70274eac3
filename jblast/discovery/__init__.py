"""Equations of motion found in recorded trajectories, with their uncertainty."""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

if TYPE_CHECKING:
    from jblast.discovery.equations import discover as discover
    from jblast.discovery.law_search import discover_law as discover_law

__getattr__, __dir__ = lazy_face(__name__)
