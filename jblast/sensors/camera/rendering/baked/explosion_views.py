r"""An explosion seen from many sides: pictures that the laws light and scale.

A set shows one explosion on the ground, from views all around and above, at phases:
times since the burst over the duration of its fireball. Nothing of it has a size or a
brightness of its own:

- each picture is shown so large that its visible radius (two standard deviations of
  its silhouette along what is level where it is shown, which of a disc is the radius)
  is that of the scene's fireball law at the time, seen as the outline of a ball of this
  radius would be; so are both pictures between which the time is, each for itself;
- its phase is the time over the law's duration of the charge;
- its light is that of a black body, by the law's temperature and the heat of each texel
  (`texels.py`), to which comes the day's light on soot and dust.

A picture stands on a billboard as in `billboards.py`, with the same up. Its foot is
where the charge is, on the ground below it as long as it is not higher than half the
largest radius, and that much below it if it is higher: it then shows a burst on the
ground that hovers. Seen from another elevation than it was taken from, the middle of
the cloud keeps its height in the world: the picture is moved so much up or down. The
wind carries the middle as it carries the law's ball, what is below it less and what is
above it more, by the height in the picture: the foot stays.

After the last phase the last picture stays, and fades within half as long again.

References:
    Parab's thesis, 3.2.2: views on the upper hemisphere, the nearest shown.
"""

from typing import ClassVar

import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene.charge import Charge
from jblast.scene.scene import Scene
from jblast.sensors.camera.geometry.pixel_rays import Rays
from jblast.sensors.camera.image.compositing import laid_over
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.baked.layer import explosion_layer, is_met
from jblast.sensors.camera.rendering.baked.pictures import FADING, Pictures
from jblast.waves.fireball import fireball_duration, fireball_growth_time


class ExplosionViews(Pictures):
    """Pictures of an explosion on the ground, as rays see them: see `Pictures`."""

    glows: ClassVar[bool] = True

    def duration(self, charge: Charge) -> Float[Array, ""]:
        """Return how long the pictures of a charge last, the fading left out [s]."""
        return self.phase[-1] * self._life(charge)

    def instants(self, charge: Charge) -> Float[np.ndarray, " instant"]:
        """Return when pictures stand, and when it grows, since the burst [s]."""
        life = float(self._life(charge))
        mass = charge.tnt_mass("fireball_radius_m")
        growing = float(fireball_growth_time(mass)) * 0.25 * 2.0 ** np.arange(6)
        phases = np.asarray(self.phase, float)
        last = (1.0 + FADING) * phases[-1:]
        return np.unique(np.concatenate([growing, life * phases, life * last]))

    def seen(
        self,
        scene: Scene,
        rays: Rays,
        time: Float[Array, ""],
        appearance: Appearance,
    ) -> Float[Array, "4 row column"]:
        """Return what rays see of a scene's charges, nearer ones in front.

        Differentiable in all numbers of scene, camera and time but at kinks: where a
        ray passes a texel's centre, at a frame's phase, and at the edge between three
        views; and at jumps: where the nearest view changes, or something hides it.
        """
        return laid_over(
            [
                explosion_layer(self, scene, charge, rays, time, appearance)
                for charge in scene.charges
            ]
        )

    def is_met(self, scene: Scene, charge: Charge, rays: Rays) -> Bool[Array, ""]:
        """Return whether a ray ever meets the picture, where it shows anything."""
        return is_met(self, scene, charge, rays)

    def _life(self, charge: Charge) -> Float[Array, ""]:
        return fireball_duration(charge.tnt_mass("fireball_radius_m"))
