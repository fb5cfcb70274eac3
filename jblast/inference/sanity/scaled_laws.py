r"""What blasts of any mass do, as tables over scaled distance: laws of 1 kg, scaled.

By Hopkinson's scaling a charge of $M$ at distance $r$ has the pressures that 1 kg has
at $Z = r / M^{1/3}$, and times and impulses $M^{1/3}$ as large (Baker, Explosions in
Air, 1973, ch. 3).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.registry import law_for
from jblast.scene import Scene
from jblast.sensors.calculator import evaluate

LAWS = {
    "air_arrival_s": "shock_kinematics",
    "peak_overpressure_pa": "shock_kinematics",
    "positive_impulse_pa_s": "shock_kinematics",
    "positive_duration_s": "shock_kinematics",
    "reflected_pressure_pa": "kingery_bulmash",
    "reflected_impulse_pa_s": "kingery_bulmash",
}
"""Laws that hold from the charge to where it is inaudible; reflected ones go on as
power laws."""
WITH_MASS = {
    "air_arrival_s",
    "positive_impulse_pa_s",
    "positive_duration_s",
    "reflected_impulse_pa_s",
}
"""What grows with the cube root of the mass at one scaled distance."""
NEAREST, FARTHEST, POINTS = 1e-3, 1e6, 901
"""Scaled distances of the tables [m/kg^(1/3)]: 100 a decade."""

LARGEST = 50e6 * 1e3 * 4.184e6 / TNT_SPECIFIC_ENERGY
"""Mass of TNT of the largest explosion made so far [kg]: 50 Mt, 30 October 1961
(Adamsky and Smirnov, Cold War International History Project Bulletin 4, 1994)."""
SMALLEST = 1e-6
"""A milligram [kg]: what microscale experiments detonate (declared)."""


@dataclass(frozen=True)
class ScaledLaws:
    """Laws of 1 kg of an explosive in the air of a scene.

    Attributes:
        log_z: ln of scaled distance.
        log_value: By quantity, ln of its value at each.
        near: By quantity, the least scaled distance at which its law holds.
    """

    log_z: Float[np.ndarray, " z"]
    log_value: dict[str, Float[np.ndarray, " z"]]
    near: dict[str, float]

    def predicted(
        self,
        quantity: str,
        distance: Float[np.ndarray, "..."],
        mass: Float[np.ndarray, "..."],
    ) -> Float[np.ndarray, "..."]:
        """Return ln of what a quantity is at some distances from some masses."""
        third = np.log(mass) / 3
        log_z = np.log(np.maximum(distance, 1e-6)) - third
        step = self.log_z[1] - self.log_z[0]
        place = np.clip((log_z - self.log_z[0]) / step, 0, len(self.log_z) - 1.000001)
        left = place.astype(int)
        share = place - left
        table = self.log_value[quantity]
        value = table[left] * (1 - share) + table[left + 1] * share
        return value + third if quantity in WITH_MASS else value

    def fastest(self) -> float:
        """Return the mean speed [m/s] to the nearest place that a law holds at."""
        log_z = self._valid("air_arrival_s")
        return float(
            np.exp(log_z - self.log_value["air_arrival_s"][-len(log_z) :]).max()
        )

    def largest(self, quantity: str, distance: float) -> float:
        """Return the most that a valid law gives at a distance, whatever the mass."""
        return float(np.exp(self._along(quantity, distance).max()))

    def masses(self, quantity: str, value: float, distance: float) -> np.ndarray:
        """Return each mass [kg] that gives a value at a distance, where laws hold."""
        along = self._along(quantity, distance) - np.log(value)
        mass = (distance / np.exp(self._valid(quantity))) ** 3
        crossed = np.flatnonzero(np.diff(np.sign(along)) != 0)
        share = along[crossed] / (along[crossed] - along[crossed + 1])
        log_mass = np.log(mass)
        return np.exp(
            log_mass[crossed] + share * (log_mass[crossed + 1] - log_mass[crossed])
        )

    def _valid(self, quantity: str) -> Float[np.ndarray, " z"]:
        return self.log_z[self.log_z >= np.log(self.near[quantity])]

    def _along(self, quantity: str, distance: float) -> Float[np.ndarray, " z"]:
        """Return ln of a quantity at one distance for every mass it is told of."""
        log_z = self._valid(quantity)
        value = self.log_value[quantity][-len(log_z) :]
        third = np.log(distance) - log_z
        return value + third if quantity in WITH_MASS else value


def scaled_laws(scene: Scene) -> ScaledLaws:
    """Tabulate the laws for 1 kg of a scene's explosive, in its air.

    By the curves of a burst on the ground, unless the scene says otherwise: the others
    are those of half the mass or so, which no doubt depends on.
    """
    charge = replace(scene.charge, burst=scene.charge.burst or "surface")
    scene = replace(scene, charge=charge)
    z = np.geomspace(NEAREST, FARTHEST, POINTS)
    laws = tuple(law_for(quantity, name) for quantity, name in LAWS.items())
    value, valid = evaluate(scene, z, np.ones_like(z), laws)
    n = len(laws)  # what they give together comes after
    return ScaledLaws(
        log_z=np.log(z),
        log_value=dict(zip(LAWS, np.log(value[:n]), strict=True)),
        near={q: float(z[ok].min()) for q, ok in zip(LAWS, valid[:n], strict=True)},
    )
