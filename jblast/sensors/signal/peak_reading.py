r"""What a record says of a peak: a reading, or where it was clipped a lower bound.

A compressed sample $y = x\,(1 + (x/F)^8)^{-1/8}$ (see `quantise`) is expanded again,
$x = y\,(1 - (y/F)^8)^{-1/8}$, up to the full scale $F$; beyond it a little noise of $y$
is any $x$, and the full scale is all that is known.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.observations import Observations, observed
from jblast.scene import Instrument, Sensor
from jblast.sensors.signal.quantise import SHARPNESS, clipping


class PeakReading(NamedTuple):
    """The peak of a record, as a row of a log has it.

    Attributes:
        value: The largest sample; where that was clipped, what it was at least.
        sigma: Error of a reading of the value, same unit.
        lower_bound: Whether it is a lower bound.
    """

    value: Float[Array, "..."]
    sigma: Float[Array, "..."]
    lower_bound: Bool[Array, "..."]


def peak_reading(
    samples: Float[Array, "*batch sample"],
    instrument: Instrument,
    *,
    relative_sigma: Float[ArrayLike, ""] = 0.05,
) -> PeakReading:
    """Return the peak of a record; a lower bound where it was clipped.

    Suction that is clipped is no bound of the peak.

    Args:
        samples: As the instrument wrote them.
        instrument: What wrote them.
        relative_sigma: Error of its calibration, as a share of the value.
    """
    largest = jnp.max(samples, axis=-1)
    held = clipping(largest[..., None], instrument).clipped & (largest > 0)
    value = largest
    if instrument.full_scale is not None and instrument.saturation == "compress":
        full_scale = instrument.full_scale
        share = jnp.where(held, 0.0, largest / full_scale)
        expanded = largest * (1 - share**SHARPNESS) ** (-1 / SHARPNESS)
        value = jnp.where(held, full_scale, expanded)
    return PeakReading(value, jnp.asarray(relative_sigma) * jnp.abs(value), held)


def peak_log(
    sensors: Sequence[Sensor], readings: Sequence[PeakReading], *, shot: str = ""
) -> Observations:
    """Return peaks as a log: a row of peak overpressure for each sensor.

    Args:
        sensors: Who recorded; each stands where its position says.
        readings: The peak of each one's record [Pa].
        shot: Name of the event, where a log has several.
    """
    n = len(sensors)
    bound = np.array([bool(reading.lower_bound) for reading in readings], bool)
    return observed(
        [sensor.name for sensor in sensors],
        ("peak_overpressure_pa",) * n,
        [float(reading.value) for reading in readings],
        [float(reading.sigma) for reading in readings],
        position=np.array([sensor.position_m for sensor in sensors]).reshape(n, 3),
        shot=(shot,) * n,
        lower_bound=bound if bound.any() else None,
    )
