"""What gains are tuned by, and what came of it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jblast.scene import VehicleSpec
from jblast.study.gains.flights import Outcomes
from jblast.vehicle.control.position_hold import Gains
from jblast.vehicle.control.stability import Margins


@dataclass(frozen=True)
class Wish:
    """How gains are tuned.

    Attributes:
        margin_db: Least of the gain margins, upwards and downwards [dB].
        margin_deg: Least of the phase margins [degrees].
        delay_s: Of the real loop, that the flights do not have: sensors, computing [s].
        vehicles: Blasts that gains are tuned by.
        unseen: Blasts that they are judged by.
        seed: Of the blasts.
        motor_lead: Most by which the motors' lag may be shortened; 1: the scene's lead
            stays.
    """

    margin_db: float = 6.0
    margin_deg: float = 35.0
    delay_s: float = 0.0
    vehicles: int = 32
    unseen: int = 200
    seed: int = 0
    motor_lead: float = 1.0


@dataclass(frozen=True)
class Tried:
    """A hold with some gains.

    Attributes:
        gains: The gains.
        margins: Of each loop of `control.stability.LOOPS`.
        outcomes: Of the unseen blasts.
    """

    gains: Gains
    margins: Margins
    outcomes: Outcomes

    @property
    def gain_margin_db(self) -> float:
        """Least gain margin of all loops, upwards or downwards [dB]."""
        return float(np.min(np.asarray(self.margins.gain_db)))

    @property
    def phase_margin_deg(self) -> float:
        """Least phase margin of all loops [degrees]."""
        return float(np.min(np.asarray(self.margins.phase_deg)))


@dataclass(frozen=True)
class TunedGains:
    """Gains before and after.

    Attributes:
        vehicle: What the scene says of it.
        wish: How they were tuned.
        before: The scene's.
        after: The tuned ones.
        ln_peaks: What was made least (`tune.py`), at each step of the search.
        converged: Whether the search ended of itself.
        notes: What there is to say of the curves that the blasts were taken by.
    """

    vehicle: VehicleSpec
    wish: Wish
    before: Tried
    after: Tried
    ln_peaks: tuple[float, ...]
    converged: bool
    notes: tuple[str, ...] = ()

    def cut(self, share: float = 0.5) -> float:
        """Return by how much a quantile of the peak deviation is less; 0.2: a fifth."""
        before, after = (
            float(np.quantile(known_peaks(one), share))
            for one in (self.before, self.after)
        )
        return 1.0 - after / before


def known_peaks(tried: Tried) -> Float[np.ndarray, " flight"]:
    """Return the peak deviations [m]; who ran away has an infinite one."""
    lost = ~np.isfinite(tried.outcomes.error_m).all(axis=-1)
    return np.where(lost, np.inf, tried.outcomes.peaks_m)
