"""Which effects rows share, before they are laid out one column each."""

from collections.abc import Mapping

import equinox as eqx
import numpy as np

from jblast.registry import Law, call, law_for
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
        for name, _ in components(quantity):
            of_path = _path_scatter(law_for(name, laws[name]), scene, layout, row)
            if not (isinstance(of_path, int | float) and of_path == 0):
                found.add((name, shot))
    return frozenset(found)


def _path_scatter(law: Law, scene: Scene, layout: Layout, row: int):
    """Return a law's scatter from path to path: its shape, or the number it is."""

    def scatter():
        charge = scene.charges[layout.shot[row]]
        path = path_to(scene, layout.only(np.array([row])), charge)
        return call(law.scatter, path)[1]

    return eqx.filter_eval_shape(scatter)


def count_effects(scene: Scene, layout: Layout, laws: Mapping[str, str]) -> int:
    """Return how many effects rows share, at most.

    One for each quantity and charge, one more where the law has a far scatter, and one
    for each path where `path_effects` says.
    """
    if not scene.scatter:
        return 0
    kinds = {
        (name, shot)
        for quantity, shot in set(zip(layout.quantity, layout.shot, strict=True))
        for name, _ in components(quantity)
    }
    far = sum(law_for(name, laws[name]).far_scatter is not None for name, _ in kinds)
    paths = len(set(layout.group))
    return len(kinds) + far + paths * len(path_effects(scene, layout, laws))
