"""What a fit does not take as known of a fireball that was seen: how fast it grew."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from jblast.quantities import BY_CAMERA, FIREBALL_RADII
from jblast.scene import Free, Scene, UncertainScene, with_values
from jblast.waves.fireball import fireball_growth_time

GROWTH = "fireball_growth_s"


def as_seen(
    uncertain: UncertainScene,
    quantity: Sequence[str],
    time: Float[np.ndarray, " row"],
) -> UncertainScene:
    """Return a scene as a log with a fireball's radii is read; without any, unchanged.

    The growth time is free unless the scene says otherwise: no source tells it better
    than to a factor of two. It starts at a third of the time the radii span.

    Light is taken to be there at once where radii are read off images. Their times have
    no delay either, so the origin time is that of the light at the camera, 3 us late a
    kilometre. A delay of the flash alone would be taken for news of the range: readings
    of a millisecond would place the charge some 100 km away.

    Args:
        uncertain: The scene.
        quantity: Of each row of the log.
        time: Of each row, by its clock [s]; NaN if it has none.
    """
    radii = time[np.isin(quantity, FIREBALL_RADII)]
    if radii.size == 0:
        return uncertain
    scene = replace(uncertain.scene, instant_light=bool(set(BY_CAMERA) & set(quantity)))
    beliefs = dict(uncertain.beliefs)
    if scene.fireball_growth is None:  # a belief puts its start into the scene
        start = np.ptp(radii) / 3 or own_growth(scene)
        scene = with_values(scene, {GROWTH: start})
        beliefs[GROWTH] = Free(positive=True)
    return replace(uncertain, scene=scene, beliefs=beliefs)


def own_growth(scene: Scene) -> float:
    """Return the growth time that the law has of itself for a scene's first charge."""
    return float(fireball_growth_time(scene.charge.tnt_mass("fireball_radius_m")))
