r"""The range or the mass at which a law gives a value: all of them, or none.

A law need not fall with distance: blends of printed fits may bump, a duration turns
back near the charge. So its sign against the value is looked at on a grid even in
$\ln Z$, a point every 0.4 %, and each change is bisected to rounding. Two roots
between two points are not seen.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.registry import Law
from jblast.sensors.calculator.forward import calculated_laws, evaluate
from jblast.sensors.calculator.question import (
    Question,
    charge_radius,
    scene_path,
)

SCALED_DISTANCES = np.geomspace(1e-2, 1e5, 4096)
"""Where roots are looked for [m/kg^(1/3)]."""
BISECTIONS = 48
"""Of 0.4 %: to 1e-17 in ln, past rounding."""


@dataclass(frozen=True)
class Roots:
    """Where one law gives the value.

    Attributes:
        law: The law.
        value: Ranges [m] or masses of the explosive [kg], ascending.
        valid: Whether the law holds there, outside the charge.
        attained: Least and largest value of the law where it holds; None where it
            holds nowhere.
    """

    law: Law
    value: Float[np.ndarray, " root"]
    valid: Bool[np.ndarray, " root"]
    attained: tuple[float, float] | None

    def best(self) -> tuple[float, bool] | None:
        """Return the first valid root, else the first, and whether it is valid."""
        if not len(self.value):
            return None
        first = int(np.argmax(self.valid))  # 0 where none is
        return float(self.value[first]), bool(self.valid[first])


def roots(question: Question) -> dict[str, Roots]:
    """Return by law where the quantity asked about takes its value.

    Args:
        question: With a quantity, its target, and either one range or one mass.
    """
    laws = calculated_laws(question.quantity)
    log_x = np.log(_grid(question))
    value, valid = _along(question, log_x, laws)
    above = value >= question.target
    law, left = np.nonzero(above[:, 1:] != above[:, :-1])
    low, high = log_x[left], log_x[left + 1]
    start = above[law, left]
    for _ in range(BISECTIONS if len(law) else 0):
        middle = 0.5 * (low + high)
        now = _along(question, middle, laws)[0][law, np.arange(len(law))]
        same = (now >= question.target) == start
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    found = 0.5 * (low + high)
    holds = _along(question, found, laws)[1] if len(law) else np.zeros((len(laws), 0))
    return {
        one.name: Roots(
            law=one,
            value=np.exp(found[law == i]),
            valid=holds[i, law == i].astype(bool),
            attained=_span(value[i, valid[i]]),
        )
        for i, one in enumerate(laws)
    }


def _grid(question: Question) -> Float[np.ndarray, " point"]:
    """Return ranges or masses of the explosive to look at, ascending."""
    factor = float(question.scene.charge.tnt_factor_for(question.quantity))
    pressure = scene_path(question.scene).ambient_pressure.item()
    scale = factor * STANDARD_PRESSURE / pressure
    if question.charge_mass:
        return SCALED_DISTANCES * np.cbrt(scale * question.charge_mass[0])
    return (question.slant_range[0] / SCALED_DISTANCES[::-1]) ** 3 / scale


def _along(
    question: Question, log_x: Float[np.ndarray, " point"], laws: tuple[Law, ...]
) -> tuple[Float[np.ndarray, "law point"], Bool[np.ndarray, "law point"]]:
    """Return the laws, and where they hold, along what is asked for."""
    x = np.exp(log_x)
    if question.charge_mass:
        slant_range, mass = x, np.full_like(x, question.charge_mass[0])
    else:
        slant_range, mass = np.full_like(x, question.slant_range[0]), x
    value, valid = evaluate(question.scene, slant_range, mass, laws)
    return value, valid & (slant_range > charge_radius(mass))


def _span(values: Float[np.ndarray, " point"]) -> tuple[float, float] | None:
    return (float(values.min()), float(values.max())) if len(values) else None
