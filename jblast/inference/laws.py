"""Automatic choice of laws and curve sets, which depends on the answer."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.fidelity import TakenLaw
from jblast.scene import Scene
from jblast.sensors import Layout, resolve_laws
from jblast.sensors.law_choice import law_names, settled


class Choices(NamedTuple):
    """Automatic choices for a scene.

    Attributes:
        scene: Scene whose charges have the curve sets of their heights.
        layout: Layout with the curve set of each row, if a charge has both.
        laws: The law of each quantity, with the reason for its choice.
    """

    scene: Scene
    layout: Layout
    laws: Mapping[str, TakenLaw]

    def other_laws(self, used: Mapping[str, str]) -> dict[str, str]:
        """Return the chosen laws of quantities for which another was used."""
        return {k: n for k, n in law_names(self.laws).items() if used[k] != n}

    def has_bursts_of(self, scene: Scene, layout: Layout) -> bool:
        """Return True if the curve sets are the same."""
        mine, others = (
            [charge.burst for charge in of.charges] for of in (self.scene, scene)
        )
        return mine == others and self.layout.free_air == layout.free_air


def choices_for(
    scene: Scene, rows: Layout, sigma: Float[np.ndarray, " row"]
) -> Choices:
    """Return the choices for a scene and the rows and errors of a log."""
    scene, layout = settled(scene, rows)
    return Choices(scene, layout, resolve_laws(scene, layout, sigma))
