"""What of a reading a plot shows: an arrival less the time sound would have taken.

Arrivals over two decades of range hide a millisecond; less range over speed, they show
how much the shock outran sound, and the residuals can be seen.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from jblast.constants import LIGHT_SPEED
from jblast.inference.fitting.result import Fit
from jblast.waves.propagation.ambient import sound_speed_of


@dataclass(frozen=True)
class Reduction:
    """A time that grows with range, to be taken off arrivals.

    Attributes:
        origin: Constant part, on the common clock [s].
        slowness: Seconds a metre.
        label: What the remaining time is called on an axis.
    """

    origin: float
    slowness: float
    label: str

    def __call__(
        self, time: Float[np.ndarray, " n"], distance: Float[np.ndarray, " n"]
    ) -> Float[np.ndarray, " n"]:
        """Return times less what is taken off."""
        return time - self.origin - distance * self.slowness


def axis_sound_speed(fit: Fit) -> float:
    """Return the speed of sound at the answer [m/s]; the axis names it.

    Where it is not identified, any would fit; then it is that of the air's temperature.
    """
    air = fit.scene.air
    if air.sound_speed is not None and (
        "air_sound_speed_m_s" not in fit.summary.unidentified
    ):
        return float(air.sound_speed)
    return float(sound_speed_of(replace(air, sound_speed=None)))


def reduction(fit: Fit, quantity: str, shot: int) -> Reduction | None:
    """Return what a plot takes off a quantity; None where it shows the value itself."""
    t0 = float(fit.scene.charges[shot].time_s)
    air = axis_sound_speed(fit)
    ground = float(fit.scene.ground.p_speed)
    if quantity == "air_arrival_s":
        return Reduction(t0, 1 / air, f"travel time − range / {air:.1f} m/s")
    if quantity == "ground_arrival_s":
        return Reduction(t0, 1 / ground, f"travel time − range / {ground:.0f} m/s")
    if quantity == "arrival_difference_s":
        label = f"difference − range × (1/{air:.1f} − 1/{ground:.0f}) s/m"
        return Reduction(0.0, 1 / air - 1 / ground, label)
    if quantity == "flash_time_s":
        return Reduction(t0, 1 / LIGHT_SPEED, "flash − origin time")
    return None


def common_clock(fit: Fit) -> Float[np.ndarray, " row"]:
    """Return what to take off each row's clock to read the common clock [s]."""
    offsets = fit.scene.clock_offsets()
    values = [
        0.0 if f"clock_offset_s.{clock}" in fit.summary.unidentified else offset
        for clock, offset in offsets.items()
    ]
    by_name = dict(zip(offsets, map(float, values), strict=True))
    return np.array([by_name.get(clock, 0.0) for clock in fit.observations.clocks()])
