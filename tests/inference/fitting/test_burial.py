"""A buried charge is judged as deep as its posterior reaches."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.fidelity.choose import TakenLaw
from jblast.inference import Posterior
from jblast.inference.fitting.assumptions import valid_at_depth
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.warnings import height_beside_the_curves, outside
from jblast.inference.mode.laplace import Laplace
from jblast.inference.posterior.parameters import parameters_of
from jblast.report.fit.findings import all_words
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import planned_layout

LAWS = {"positive_impulse_pa_s": "ford_2021"}
MASS, UP = 1500.0, -2.1  # -0.183 m/kg^(1/3), where ford_2021 holds, to -0.2


def found(up=UP, laws=LAWS, free=("charge_mass_kg",), far=1500.0):
    """What a fit found: this mass, by impulses at two places."""
    sensors = tuple(
        Sensor(
            name, jnp.array([east, 0.0, 0.0]), records=(("positive_impulse_pa_s", 0.1),)
        )
        for name, east in (("a", 800.0), ("b", far))
    )
    scene = dataclasses.replace(Scene(), sensors=sensors)
    scene = with_values(scene, {"charge_mass_kg": MASS, "charge_up_m": up})
    layout, sigma, _ = planned_layout(scene)
    parameters = parameters_of(freed(UncertainScene(scene), list(free)))
    posterior = Posterior(parameters, layout, sigma, sigma, tuple(laws.items()))
    at = {"charge_mass_kg": np.log(MASS)}
    z = np.array([at.get(name, 0.0) for name in free])
    normal = Laplace(z, np.eye(len(z)), 0.0, True)
    named = {q: TakenLaw(name) for q, name in laws.items()}
    return Solution(posterior, named, {}, None, None, normal)  # pyright: ignore[reportArgumentType]  not asked for


# (2.1/0.2)^3 = 1158 kg would lie at the end of the range: 0.26 below 1500 kg in ln,
# 1.6 sd of 0.16
@pytest.mark.parametrize(("sd", "holds"), [(0.1, True), (0.15, True), (0.17, False)])
def test_an_answer_carried_into_range_by_its_own_estimate_is_marked(sd, holds):
    draws = np.log(MASS) + sd * np.random.default_rng(0).standard_normal((8000, 1))
    solution = found()
    assert solution.posterior.misfit(jnp.asarray(solution.laplace.z)).valid.all()
    valid = valid_at_depth(solution, draws)
    assert (valid == holds).all()
    if not holds:
        log = dataclasses.make_dataclass("Log", ["quantity"])(
            ("positive_impulse_pa_s",) * 2
        )
        assert outside(log, solution, valid).is_deeper


def test_what_else_a_draw_says_does_not_count():
    # the far place lies at Z = 980, and the law's range ends at 1000, 230 m beyond: a
    # third of the draws leave it by their east, none by a mass known to 1 %
    free = ("charge_mass_kg", "charge_east_m")
    solution = found(free=free, far=980.0 * np.cbrt(MASS))
    assert solution.posterior.misfit(jnp.asarray(solution.laplace.z)).valid.all()
    for seed in range(8):
        at, sd = np.array([np.log(MASS), 0.0]), np.array([0.01, 500.0])
        draws = at + sd * np.random.default_rng(seed).standard_normal((2000, 2))
        assert valid_at_depth(solution, draws).all()


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
    solution = found(up=0.0, laws={quantity: law})
    posterior = eqx.tree_at(
        lambda p: p.parameters.scene.charge,
        solution.posterior,
        dataclasses.replace(
            solution.posterior.parameters.scene.charge, burst="free-air"
        ),
    )
    solution = solution._replace(posterior=posterior)
    told = height_beside_the_curves(solution, posterior.parameters.scene.charge)
    assert any("contradicts the height" in said for said in all_words(told)) == asks
