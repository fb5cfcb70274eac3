"""A buried charge is judged as deep as its posterior reaches."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jblast.inference.answer import Answer
from jblast.inference.density import density_of
from jblast.inference.fitting.assumptions import valid_at_depth
from jblast.inference.fitting.warnings import height_beside_the_curves, outside
from jblast.report.messages import sentences_of
from jblast.scene import Scene, UncertainScene, freed, with_values
from jblast.waves.choice import TakenLaw
from tests.inference.logs import log

LAWS = {"positive_impulse_pa_s": "ford_2021"}
MASS, UP = 1500.0, -2.1  # -0.183 m/kg^(1/3), where ford_2021 holds, to -0.2


def found(
    up=UP, laws=LAWS, free=("charge_mass_kg",), far=1500.0, draws=None, burst=None
) -> Any:
    """What a fit found: this mass, by impulses at two places."""
    (quantity, name) = next(iter(laws.items()))
    rows = [
        (n, quantity, 100.0, 10.0, (x, 0.0, 0.0)) for n, x in (("a", 800.0), ("b", far))
    ]
    scene = with_values(Scene(), {"charge_mass_kg": MASS, "charge_up_m": up})
    scene = dataclasses.replace(scene, law=((quantity, name),))
    if burst:
        charge = dataclasses.replace(scene.charge, burst=burst)
        scene = dataclasses.replace(scene, charges=(charge,))
    density = density_of(log(*rows), freed(UncertainScene(scene), list(free)))
    values = np.array([{"charge_mass_kg": MASS}.get(n, 0.0) for n in free])
    if draws is None:
        draws = values[None]
    return SimpleNamespace(
        density=density,
        answer=Answer(density, values, np.ones(len(free))),
        draws=SimpleNamespace(
            u=draws, values=draws, weights=np.full(len(draws), 1 / len(draws))
        ),
        laws={quantity: TakenLaw(name)},
    )


# (2.1/0.2)^3 = 1158 kg would lie at the end of the range: 0.26 below 1500 kg in ln,
# 1.6 sd of 0.16
@pytest.mark.parametrize(("sd", "holds"), [(0.1, True), (0.15, True), (0.17, False)])
def test_an_answer_carried_into_range_by_its_own_estimate_is_marked(sd, holds):
    draws = np.exp(np.log(MASS) + sd * np.random.default_rng(0).normal(size=(8000, 1)))
    solution = found(draws=draws)
    assert solution.answer.valid.all()
    valid = valid_at_depth(solution)
    assert (valid == holds).all()
    if not holds:
        made, there = solution.density.observations, solution.answer.valid
        assert outside(made, solution.laws, valid, there).kind.endswith("_below")


def test_what_else_a_draw_says_does_not_count():
    # the far place lies at Z = 980, and the law's range ends at 1000, 230 m beyond: a
    # third of the draws leave it by their east, none by a mass known to 1 %
    free = ("charge_mass_kg", "charge_east_m")
    for seed in range(8):
        drawn = np.random.default_rng(seed).standard_normal((2000, 2))
        draws = np.stack([MASS * np.exp(0.01 * drawn[:, 0]), 500.0 * drawn[:, 1]], 1)
        solution = found(free=free, far=980.0 * np.cbrt(MASS), draws=draws)
        assert solution.answer.valid.all()
        assert valid_at_depth(solution).all()


PRESSURE, IMPULSE = "peak_overpressure_pa", "positive_impulse_pa_s"


@pytest.mark.parametrize(
    ("quantity", "law", "asks"),
    [
        (IMPULSE, "kingery_bulmash", True),
        (PRESSURE, "weak_shock", True),  # of two curve sets
        (IMPULSE, "swisdak", True),  # of one, where it holds
        (IMPULSE, "ford_2021", False),  # of heights themselves
    ],
)
def test_a_burst_against_the_height_is_marked_where_a_law_asks_for_it(
    quantity, law, asks
):
    solution = found(up=0.0, laws={quantity: law}, burst="free-air")
    charge = solution.answer.scene.charge
    told = height_beside_the_curves(solution.answer, solution.laws, charge)
    assert any("contradicts the height" in one for one in sentences_of(told)) == asks
