"""Laws, likelihoods and samplers of a user: the code of two pages of the manual."""

import re
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal

import jblast.waves  # registers its laws
from jblast.registry import LAWS, Law, declared_scatter

HOWTO = Path(__file__).parents[2] / "docs/howto"


def blocks(page):
    """Return the Python of a page."""
    return re.findall(r"^```python\n(.*?)^```", (HOWTO / page).read_text(), re.M | re.S)


BLOCKS = blocks("own_sampler.md")
LOG = """sensor,range_m,quantity,value,sigma
a,20,air_arrival_s,0.1301,0.001
b,40,air_arrival_s,0.1801,0.001
c,60,air_arrival_s,0.2346,0.001
c,60,peak_overpressure_pa,12000,600
"""
INTERVAL = "print(np.quantile"


@pytest.fixture(autouse=True, scope="module")
def default_promotion():
    """Settings of JAX as users of the page have them; those of the tests are strict."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """Names that the first two blocks of the page define."""
    folder = tmp_path_factory.mktemp("fit")
    (folder / "log.csv").write_text(LOG)
    defined = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        exec(BLOCKS[0], defined)
        exec(BLOCKS[1], defined)
    return defined


@pytest.mark.slow
def test_the_log_density_is_a_plain_function_with_its_optimum_at_the_start(names):
    found = names["found"]
    start = jnp.asarray(found.start)
    assert found.names == ("charge_mass_kg", "origin_time_s")
    value, slope = jax.jit(jax.value_and_grad(found.log_density))(start)
    # in standard deviations of the posterior
    assert np.linalg.norm(names["root"].T @ slope) < 1e-3
    assert value == pytest.approx(float(jax.jit(found.density.log_density)(start)))
    many = jax.jit(jax.vmap(found.log_density))(jnp.stack([start, start + 0.1]))
    assert float(many[0]) == pytest.approx(float(value))
    assert float(many[1]) < float(value)


@pytest.mark.slow
def test_values_are_the_numbers_of_the_scene_in_their_units(names):
    found = names["found"]
    at = found.values(found.answer.z)
    assert float(at["charge_mass_kg"]) == pytest.approx(
        float(found.scene.charge.mass_kg)
    )
    assert float(at["origin_time_s"]) == pytest.approx(float(found.scene.charge.time_s))
    assert found.values(np.zeros((3, 2)))["charge_mass_kg"].tolist() == [1.0] * 3


@pytest.mark.slow
@pytest.mark.parametrize("library", ["emcee", "numpyro", "blackjax"])
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
def test_samplers_of_others_find_the_interval_of_the_fit(names, library, capsys):
    (block,) = (one for one in BLOCKS if library in one and INTERVAL in one)
    exec(block, names)
    assert capsys.readouterr().out.startswith("[")
    mass = np.asarray(names["draws"]["charge_mass_kg"])
    own = names["found"].summary.estimates["charge_mass_kg"]
    # a fifth of a standard deviation is the error of a quantile of 500 independent
    # draws; the function is a bound on the density, and some per cent narrower
    near = 0.3 * own.sd
    assert np.quantile(mass, [0.05, 0.5, 0.95]) == pytest.approx(
        [own.q05, own.q50, own.q95], abs=near
    )


@pytest.mark.slow
def test_an_optimiser_of_others_finds_the_optimum(names):
    (block,) = (one for one in BLOCKS if "import optimistix" in one)
    exec(block, names)
    best = names["place"](np.asarray(names["best"].value))
    # in standard deviations: both are the optimum of one function
    off = np.linalg.solve(names["root"], best - names["found"].start)
    np.testing.assert_allclose(off, 0.0, atol=1e-4)


@pytest.mark.slow
def test_a_law_and_a_likelihood_of_a_user_are_fitted_and_compared(
    tmp_path, monkeypatch
):
    (tmp_path / "log.csv").write_text(LOG)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    before = dict(LAWS)
    try:
        for block in blocks("own_models.md"):
            exec(block, names)
    finally:
        LAWS.clear()
        LAWS.update(before)
    fits, best = names["fits"], names["found"].values(names["best"].value)
    assert fits["our_range"].log_evidence == names["found"].log_evidence
    mass = fits["our_range"].summary.estimates["charge_mass_kg"]
    assert mass.q05 < float(best["charge_mass_kg"]) < mass.q95


@pytest.mark.slow
def test_the_evidence_of_two_scatters_is_that_of_an_integral_of_normal_densities():
    ranges, value = np.array([30.0, 50.0, 70.0]), np.array([2.1e4, 9.3e3, 5e3])
    relative = np.array([0.05, 0.06, 0.06])
    log = pd.DataFrame(
        {
            "sensor": ["a", "b", "c"],
            "quantity": "peak_overpressure_pa",
            "value": value,
            "sigma": relative * value,
            "range_m": ranges,
        }
    )
    ln_mass = np.linspace(-5.0, 12.0, 4001)
    away = np.log(value) - np.log(6e5) + 1.6 * (np.log(ranges) - ln_mass[:, None] / 3)
    evidence, exact = [], []
    for shot, record in ((0.3, 0.1), (0.0, 0.0)):
        law = Law(
            quantity="peak_overpressure_pa",
            name="power",
            function=lambda slant_range, charge_mass: (
                6e5 * (slant_range / jnp.cbrt(charge_mass)) ** -1.6
            ),
            range="everywhere",
            source="this test",
            valid=lambda slant_range: slant_range > 0,
            scatter=declared_scatter(shot=shot, record=record),
            scatter_source="declared",
        )
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(LAWS, (law.quantity, law.name), law)
            found = jblast.fit(log, laws="power", noise="gaussian")
        evidence.append(found.log_evidence)
        covariance = np.diag(relative**2 + record**2) + shot**2
        density = multivariate_normal(np.zeros(3), covariance).pdf(away)
        exact.append(np.log(np.trapezoid(density, ln_mass)))
    # each evidence has a standard error of about 0.02 from its draws
    assert np.diff(evidence) == pytest.approx(np.diff(exact), abs=0.1)
