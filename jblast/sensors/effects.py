"""Which effects rows share, before they are laid out one column each."""

from collections.abc import Mapping

import numpy as np

from jblast.registry import call, law_for
from jblast.scene import Scene
from jblast.sensors.layout import Layout, components
from jblast.sensors.record import path_to


def path_effects(
    scene: Scene, layout: Layout, laws: Mapping[str, str]
) -> frozenset[tuple[str, int]]:
    """Return of which quantities, and charges, every path has an effect of its own.

    Args:
        scene: Its `scatter` says whether laws scatter at all.
        layout: Rows of a log.
        laws: Name of the law for each of `layout.quantities()`.
    """
    if not scene.scatter:
        return frozenset()
    first: dict[tuple[str, int], int] = {}
    for row, key in enumerate(zip(layout.quantity, layout.shot, strict=True)):
        first.setdefault(key, row)
    found = set()
    for (quantity, shot), row in first.items():
        path = path_to(scene, layout.only(np.array([row])), scene.charges[shot])
        for name, _ in components(quantity):
            _, of_path, _ = call(law_for(name, laws[name]).scatter, path)
            if not (isinstance(of_path, int | float) and of_path == 0):
                found.add((name, shot))
    return frozenset(found)


def count_effects(scene: Scene, layout: Layout, laws: Mapping[str, str]) -> int:
    """Return how many effects rows share, at most.

    One for each quantity and charge, and one for each path where `path_effects` says.
    """
    if not scene.scatter:
        return 0
    kinds = {
        (name, shot)
        for quantity, shot in set(zip(layout.quantity, layout.shot, strict=True))
        for name, _ in components(quantity)
    }
    paths = len(set(layout.group))
    return len(kinds) + paths * len(path_effects(scene, layout, laws))
