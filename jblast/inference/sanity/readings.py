"""The rows of one shot that laws of a blast can be held against, as plain arrays."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.inference.sanity.scaled_laws import LAWS, ScaledLaws
from jblast.observations import Observations
from jblast.parameters import CLOCK_OFFSET
from jblast.scene import Scene

SIGMAS = 5.0
"""A reading this many sigmas away is no error of reading."""
FACTOR = 3.0
"""What a pressure, an impulse or a duration may be off by: a reflection doubles it, and
a law, a burst in the air, or ground between may halve it."""
SHARE = 0.07
"""What a travel time may be off by: wind, air that is not the scene's."""
FAR, FAR_SHARE = 20e3, 0.25
"""Past this distance [m] sound goes through the stratosphere, at 280 m/s and less
(Negraru et al., J. Geophys. Res. 115, D15110, 2010; read second-hand)."""
CLOCK_STEP = 1e-3
"""What any arrival may be off by [s]."""
NO_CLOCK = -1


@dataclass(frozen=True)
class Readings:
    """Rows of one shot, in the space their errors live in.

    Attributes:
        row: Which row of the log each is.
        quantity: What it is.
        value: Seconds for readings of a clock, ln for all else.
        position: East, north, up of the sensor [m]; NaN where a range is told.
        slant_range: Distance from the charge [m]; NaN where a position is told.
        clock: Number of its clock, 0 the common one; -1 for what is no clock's.
        error: `SIGMAS` of its sigma, same unit.
        bound: Whether it is a lower bound.
    """

    row: Int[np.ndarray, " n"]
    quantity: tuple[str, ...]
    value: Float[np.ndarray, " n"]
    position: Float[np.ndarray, "n 3"]
    slant_range: Float[np.ndarray, " n"]
    clock: Int[np.ndarray, " n"]
    error: Float[np.ndarray, " n"]
    bound: Bool[np.ndarray, " n"]

    @property
    def timed(self) -> Bool[np.ndarray, " n"]:
        """Which are readings of a clock."""
        return self.clock >= 0

    def distances(
        self, places: Float[np.ndarray, "place 3"]
    ) -> Float[np.ndarray, "place n"]:
        """Return how far each sensor is from a charge at some places [m]."""
        apart = np.linalg.norm(self.position - places[:, None], axis=-1)
        return np.where(np.isnan(self.slant_range), apart, self.slant_range)

    def travelled(
        self,
        laws: ScaledLaws,
        distance: Float[np.ndarray, "place n"],
        mass: Float[np.ndarray, " place"],
    ) -> Float[np.ndarray, "place n"]:
        """Return what each would be: seconds since the shot, or ln."""
        predicted = np.zeros_like(distance)
        for quantity in dict.fromkeys(self.quantity):
            here = np.array([q == quantity for q in self.quantity])
            if quantity != "flash_time_s":
                law = laws.predicted(quantity, distance[:, here], mass[:, None])
                predicted[:, here] = np.exp(law) if quantity == "air_arrival_s" else law
        return predicted

    def allowed(
        self,
        predicted: Float[np.ndarray, "place n"],
        distance: Float[np.ndarray, "place n"],
    ) -> Float[np.ndarray, "place n"]:
        """Return how far each may be off: its errors, and what laws leave open."""
        share = np.where(distance > FAR, FAR_SHARE, SHARE)
        times = CLOCK_STEP + share * predicted
        return self.error + np.where(self.timed, times, np.log(FACTOR))

    def only(self, kept: Int[np.ndarray, " _"]) -> "Readings":
        """Return some of the readings, by number."""
        return Readings(
            row=self.row[kept],
            quantity=tuple(self.quantity[i] for i in kept),
            value=self.value[kept],
            position=self.position[kept],
            slant_range=self.slant_range[kept],
            clock=self.clock[kept],
            error=self.error[kept],
            bound=self.bound[kept],
        )

    def but(self, **changed: object) -> "Readings":
        """Return the same with some fields changed."""
        return replace(self, **changed)  # pyright: ignore[reportArgumentType]  fields


def readings_of(
    observations: Observations,
    scene: Scene,
    rows: Int[np.ndarray, " row"],
    beliefs: Collection[str],
) -> Readings:
    """Return the rows that laws are held against: those with a law, and a place.

    Args:
        observations: The log.
        scene: Knows what clocks show more than the common one.
        rows: Of one shot.
        beliefs: Names of what is not fixed; a clock among them is a clock of its own.
    """
    place = observations.position
    placed = ~np.isnan(place).any(axis=1) | ~np.isnan(observations.slant_range)
    used = np.array(
        [
            row
            for row in rows
            if observations.quantity[row] == "flash_time_s"
            or (observations.quantity[row] in LAWS and placed[row])
        ],
        int,
    )
    quantity = tuple(observations.quantity[row] for row in used)
    timed = np.isin(quantity, ("flash_time_s", "air_arrival_s"))
    offsets = {name: float(x) for name, x in scene.clock_offsets().items()}
    own = observations.clocks()
    names = [
        own[row] if observations.clock[row] or f"{CLOCK_OFFSET}.{own[row]}" in beliefs
        else ""
        for row in used
    ]  # fmt: skip
    number = {name: i for i, name in enumerate(dict.fromkeys(["", *names]))}
    shift = np.array([offsets.get(own[row], 0.0) for row in used])
    raw = observations.value[used]
    value = np.where(timed, raw - shift, np.log(np.where(raw > 0, raw, 1.0)))
    error = SIGMAS * np.nan_to_num(observations.error_scale()[used])
    return Readings(
        row=used,
        quantity=quantity,
        value=value,
        position=place[used],
        slant_range=observations.slant_range[used],
        clock=np.where(timed, np.array([number[n] for n in names], int), NO_CLOCK),
        error=error,
        bound=observations.bounds()[used],
    )
