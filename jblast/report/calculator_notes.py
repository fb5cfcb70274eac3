"""What no number of a calculation says by itself: where the burst is."""

import numpy as np

from jblast.sensors.question import Question, scene_path, tnt_factor_in
from jblast.waves.ground_factor import FREE_HEIGHT
from jblast.waves.scaling import sachs_distance_factor


def between_limits(question: Question) -> bool:
    """Return whether some charge bursts neither on the ground nor in free air."""
    low, high = _scaled_heights(question)
    return bool(question.charge_mass) and high > 0.0 and low < FREE_HEIGHT


def notes(question: Question, *, beside: bool = True) -> list[str]:
    """Return, in sentences, what no number of the answer says by itself.

    Args:
        question: What was asked.
        beside: Whether the answer has room for what the other curve set gives.
    """
    burst = question.scene.charge.burst
    low, high = _scaled_heights(question)
    height = f"{low:.2g}" if low == high else f"{low:.2g} to {high:.2g}"
    limit = f"about {FREE_HEIGHT:g} m/kg^(1/3)"
    said = []
    if high < 0.0:
        said.append(
            f"the charge is buried: the {burst} curves were used; ford_2021 alone "
            "takes the depth into account"
        )
    elif low > 0.0 and not question.charge_mass:
        said.append(
            f"the {burst} curves were used; a burst above the ground lies between "
            f"surface and free-air until its height is {limit}: compare with the "
            "other --burst"
        )
    elif between_limits(question):
        said.append(
            f"the charge bursts {height} m/kg^(1/3) above the ground, between the "
            f"limits: on the ground, and in free air from {limit} on; the {burst} "
            f"curves were used; {_other_set(question, beside)}"
        )
    elif low >= FREE_HEIGHT and burst == "surface":
        said.append(
            f"the charge bursts {height} m/kg^(1/3) above the ground: the surface "
            f"curves were used, but from {limit} on --burst free-air is nearer"
        )
    if low > 0.0 and burst == "free-air" and question.charge_mass:
        said.append(
            "free-air curves hold until the reflection from the ground arrives, which "
            "is not looked at"
        )
    return said


def _other_set(question: Question, beside: bool) -> str:
    if not beside or question.quantity or len(question.rows()[0]) > 1:
        return "compare with the other --burst"
    return "beside a law of two curve sets stands what the other set gives"


def _scaled_heights(question: Question) -> tuple[float, float]:
    """Return the least and the largest height of burst [m/kg^(1/3)]."""
    height = question.scene.charge.up.item()
    if not question.charge_mass:  # of an unknown mass only the sign counts
        return height, height
    factor = tnt_factor_in(question.scene, "peak_overpressure_pa").item()
    pressure = scene_path(question.scene).ambient_pressure.item()
    masses = factor * np.asarray(question.charge_mass)
    heights = height / np.asarray(sachs_distance_factor(masses, pressure))
    return float(heights.min()), float(heights.max())
