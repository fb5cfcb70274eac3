"""What no number of a calculation says by itself: where the burst is."""

import numpy as np

from jblast.report.calculator.reasons import why_taken
from jblast.report.numbers import printed_number
from jblast.sensors.calculator.disagreement import Disagreement
from jblast.sensors.calculator.question import (
    Question,
    free_air_rows,
    scene_path,
)
from jblast.waves.burst_and_height import burst_notes
from jblast.waves.scaling import sachs_distance_factor


def between_limits(question: Question) -> bool:
    """Return whether some charge bursts neither on the ground nor as in free air."""
    _, high = _scaled_heights(question)
    asked = question.quantity  # no rows yet: what is asked for may lie on either side
    return not asked and high > 0.0 and not free_air_rows(question).all()


def notes(question: Question, *, beside: bool = True) -> list[str]:
    """Return, in sentences, what no number of the answer says by itself.

    Args:
        question: What was asked.
        beside: Whether the answer has room for what the other curve set gives.
    """
    charge = question.scene.charge
    low, high = _scaled_heights(question)
    if high < 0.0:
        return [
            f"the charge is buried: the {charge.burst} curves were used; ford_2021 "
            "alone takes the depth into account"
        ]
    if high > 0.0 and question.quantity:
        return [
            f"the {charge.burst} curves were used; a burst above the ground lies "
            "between surface and free-air until its reflection comes after the "
            "positive phase: compare with the other --burst"
        ]
    if not high > 0.0:
        return []
    said = burst_notes(charge, (low, high), free_air_rows(question), "range")
    said[-1] += "; sensors were taken to stand as low as the range allows"
    if between_limits(question):
        said[-1] += f"; {_other_set(question, beside)}"
    return said


def disagreement_words(found: Disagreement, question: Question) -> str:
    """Say that laws of a quantity that hold disagree, and which one we would take."""
    where, rows = "", len(question.rows()[0])
    if rows > 1:
        place = printed_number("_m", found.range_m, system=question.units)
        where = f" at {found.rows} of {rows} rows, most at {place}"
    taken = why_taken(found)
    if found.choice:
        taken = f"we would take {found.choice.method}: {taken}"
    return (
        f"laws that hold disagree{where}: {found.high} is {found.ratio:.2f} times "
        f"{found.low}, where their scatter leaves {found.expected:.2f}; "
        f"{taken}"
    )


def _other_set(question: Question, beside: bool) -> str:
    if not beside or len(question.rows()[0]) > 1:
        return "compare with the other --burst"
    return "beside a law of two curve sets stands what the other set gives"


def _scaled_heights(question: Question) -> tuple[float, float]:
    """Return the least and the largest height of burst [m/kg^(1/3)]."""
    height = question.scene.charge.up.item()
    if not (height and question.charge_mass):  # of an unknown mass only the sign counts
        return height, height
    factor = float(question.scene.charge.tnt_factor_for("peak_overpressure_pa"))
    pressure = scene_path(question.scene).ambient_pressure.item()
    masses = factor * np.asarray(question.charge_mass)
    heights = height / np.asarray(sachs_distance_factor(masses, pressure))
    return float(heights.min()), float(heights.max())
