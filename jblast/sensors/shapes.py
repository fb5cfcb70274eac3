"""Whether arrays have the shapes of one scene and one log, told by their names."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jblast.errors import InputError
from jblast.scene import Scene, parameter_named
from jblast.scene.uncertain import leaf_of, names_in
from jblast.sensors.layout import Layout

VMAP = "; of a batch jax.vmap gives each scene in turn"


def check_scene(scene: Scene) -> None:
    """Refuse a scene whose numbers are arrays of numbers: a batch that is not mapped.

    Raises:
        InputError: One is; the message names it, the shape expected and what came.
    """
    for name in names_in(scene):
        value = leaf_of(scene, name)
        if value is not None:
            label = name.partition(".")[2]
            of = f" of {label}" if label else ""
            _check(f"scene.{parameter_named(name).attribute}{of}", value, (), VMAP)
    for sensor in scene.sensors:
        _check(f"sensor {sensor.name}: position_m", sensor.position_m, (3,), VMAP)


def check_layout(layout: Layout) -> None:
    """Refuse a layout whose columns are not of one length.

    Raises:
        InputError: One has another shape than the rows' quantities ask for.
    """
    n = len(layout.quantity)
    _check("layout.position", layout.position, (n, 3), VMAP)
    for name in ("slant_range", "time"):
        _check(f"layout.{name}", getattr(layout, name), (n,), VMAP)
    for name in ("group", "shot", "clock"):
        length = len(getattr(layout, name))
        if length != n:
            raise InputError(f"layout.{name}: expected {n} entries, got {length}")


def check_laws(laws: Mapping[str, str], layout: Layout) -> None:
    """Refuse laws that leave a quantity of a layout without one.

    Raises:
        InputError: They do.
    """
    for quantity in layout.quantities():
        if quantity not in laws:
            raise InputError(
                f"laws: expected a name for each of {', '.join(layout.quantities())}; "
                f"got none for {quantity}"
            )


def _check(name: str, value: Any, expected: tuple[int, ...], hint: str = "") -> None:
    shape = np.shape(value)
    if shape != expected:
        raise InputError(f"{name}: expected shape {expected}, got {shape}{hint}")
