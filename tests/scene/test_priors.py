import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings, strategies as st

from jblast.scene import Free, LogNormal, LogUniform, Normal, Uniform
from jblast.scene.uncertain import draw

CASES = {
    "normal": (Normal(340.0, 2.5), scipy.stats.norm(340.0, 2.5)),
    "lognormal": (
        LogNormal(15.0, 1.7),
        scipy.stats.lognorm(s=np.log(1.7), scale=15.0),
    ),
    "uniform": (Uniform(-2.0, 5.0), scipy.stats.uniform(-2.0, 7.0)),
    "loguniform": (LogUniform(0.1, 1e3), scipy.stats.loguniform(0.1, 1e3)),
}
PRIORS = pytest.mark.parametrize(("prior", "truth"), CASES.values(), ids=CASES.keys())
Z = np.linspace(-4.0, 4.0, 33)


@PRIORS
def test_the_density_in_z_is_the_density_in_x_times_the_slope(prior, truth):
    slope = jax.vmap(jax.grad(lambda z: prior.constrain(z)))(jnp.asarray(Z))
    expected = truth.logpdf(prior.constrain(Z)) + np.log(slope)
    # Rounding of the quantile near an end of an interval, 1e-16 of its width, is the
    # largest error: relative to the distance from that end 4e-12 at z = 4.
    np.testing.assert_allclose(prior.log_density(jnp.asarray(Z)), expected, rtol=1e-10)


@PRIORS
def test_draws_have_the_quantiles_of_the_distribution(prior, truth):
    keys = jax.random.split(jax.random.key(0), 4000)
    drawn = np.asarray(jax.vmap(lambda key: draw(key, prior))(keys))
    assert scipy.stats.kstest(drawn, truth.cdf).pvalue > 0.01


@PRIORS
def test_the_quantile_of_z_is_the_quantile_of_x(prior, truth):
    p = scipy.stats.norm.cdf(Z)
    # cdf(4) is 1 - 3e-5, known to 1e-16, so the point near an end to about 1e-11.
    np.testing.assert_allclose(prior.constrain(Z), truth.ppf(p), rtol=1e-10)


@pytest.mark.parametrize(
    "belief",
    [
        Free(positive=True),
        Free(positive=False),
        *(prior for prior, _ in CASES.values()),
    ],
    ids=["free positive", "free", *CASES],
)
def test_unconstrain_undoes_constrain(belief):
    # At z = 4 the quantile is within 3e-5 of 1: its rounding, 1e-16, over the density
    # there, 1e-4, is 1e-12; the interval's own rounding adds to that.
    np.testing.assert_allclose(
        belief.unconstrain(belief.constrain(jnp.asarray(Z))), Z, atol=1e-10
    )


def test_a_free_number_is_flat_in_its_z():
    free = Free(positive=True)
    np.testing.assert_array_equal(free.log_density(jnp.asarray(Z)), np.zeros_like(Z))
    np.testing.assert_allclose(free.constrain(jnp.asarray(Z)), np.exp(Z), rtol=1e-15)


@settings(deadline=None)
@given(
    st.floats(min_value=-1e6, max_value=1e6),
    st.floats(min_value=1e-3, max_value=1e6),
    st.floats(min_value=-6, max_value=6),
)
def test_an_interval_is_never_left(lo, width, z):
    for prior in (Uniform(lo, lo + width), LogUniform(width, 2 * width)):
        x = prior.constrain(jnp.asarray(z))
        ends = [float(prior.lo), float(prior.hi)]
        slack = 4e-16 * max(map(abs, ends))  # the last digit of an end
        assert ends[0] - slack <= float(x) <= ends[1] + slack
