"""What a set of pictures can be asked, whatever they are of."""

import abc
from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene.charge import Charge
from jblast.scene.scene import Scene
from jblast.sensors.camera.geometry.pixel_rays import Rays
from jblast.sensors.camera.rendering.appearance import Appearance


class ViewSet(eqx.Module):
    """Pictures of an explosion from several sides, in place of the smooth fireball.

    Attributes:
        glows: Whether its fire is as bright as the law's, and lights what is around.
    """

    glows: ClassVar[bool] = False

    @abc.abstractmethod
    def duration(self, charge: Charge) -> Float[Array, ""]:
        """Return how long the pictures of a charge last [s]."""

    @abc.abstractmethod
    def instants(self, charge: Charge) -> Float[np.ndarray, " instant"]:
        """Return when a charge's pictures change their course, since the burst [s]."""

    @abc.abstractmethod
    def seen(
        self,
        scene: Scene,
        rays: Rays,
        time: Float[Array, ""],
        appearance: Appearance,
    ) -> Float[Array, "4 row column"]:
        """Return what rays see of a scene's charges, nearer ones in front.

        Args:
            scene: Where and when the charges go off.
            rays: Where to look, and where the background is.
            time: On the common clock [s].
            appearance: How the fire is exposed, where the pictures leave that open.

        Returns:
            Linear red, green and blue times alpha, and alpha.
        """

    @abc.abstractmethod
    def is_met(self, scene: Scene, charge: Charge, rays: Rays) -> Bool[Array, ""]:
        """Return whether a ray ever meets a charge's picture, hidden or not."""
