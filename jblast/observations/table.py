"""What was measured: one row a measurement."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

QUANTITIES: dict[str, str] = {
    "flash_time_s": "light of the explosion seen, clock time",
    "air_arrival_s": "air shock or sound arrives, clock time",
    "ground_arrival_s": "ground wave arrives, clock time",
    "arrival_difference_s": "air minus ground arrival at one sensor",
    "peak_overpressure_pa": "incident peak overpressure",
    "positive_impulse_pa_s": "incident impulse of the positive phase",
    "positive_duration_s": "duration of the positive phase",
    "reflected_pressure_pa": "normally reflected peak overpressure",
    "reflected_impulse_pa_s": "normally reflected impulse",
    "shock_radius_m": "radius of the shock front at time_s",
    "ground_peak_velocity_m_s": "peak particle velocity of the ground",
    "ground_displacement_m": "peak displacement of the ground",
}
"""Every quantity a row may hold, and what it means."""

TIMES = ("flash_time_s", "air_arrival_s", "ground_arrival_s", "arrival_difference_s")
"""Quantities whose errors are in seconds; all others err in ln."""


@dataclass(frozen=True)
class Observations:
    """A tidy table: row i of every field belongs to measurement i.

    Attributes:
        sensor: Who measured.
        quantity: What, a key of `QUANTITIES`.
        value: How much, in the unit the quantity's name ends in.
        sigma: Its standard deviation, same unit; NaN leaves the law's scatter alone.
        position: East, north, up of the sensor [m]; NaN where unknown.
        slant_range: Distance from the charge [m]; NaN where a position gives it.
        time: Clock time of the measurement [s]; NaN except for `shock_radius_m`.
        path: Name of the way the wave took; "" where unsaid (then the sensor is it).
        shot: Name of the event; "" where the log has only one.
        clock: Name of the recorder; "" for the common clock.
        line: Line of the file each row stood on.
        source: The file, or "" if it was made here.
        comments: Lines that began with #, kept as provenance.
    """

    sensor: tuple[str, ...]
    quantity: tuple[str, ...]
    value: Float[np.ndarray, " row"]
    sigma: Float[np.ndarray, " row"]
    position: Float[np.ndarray, "row 3"]
    slant_range: Float[np.ndarray, " row"]
    time: Float[np.ndarray, " row"]
    path: tuple[str, ...]
    shot: tuple[str, ...]
    clock: tuple[str, ...]
    line: tuple[int, ...] = ()
    source: str = ""
    comments: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.value)

    def groups(self) -> tuple[str, ...]:
        """Return what the records of a row share: its path if named, else its sensor."""
        return tuple(p or s for p, s in zip(self.path, self.sensor, strict=True))
