import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.importance import importance, marginals_of_draws
from jblast.inference.mcmc.ensemble import ChainTooShort, ensemble
from jblast.report.fit.findings import all_words
from tests.catalogue import BOTH
from tests.inference.shots import five_solved, place_of, shot, solved

pytestmark = pytest.mark.slow  # each layout compiles its own search


def test_a_normal_posterior_is_met_and_both_samplers_agree():
    posterior, normal, told, found = five_solved("gaussian")
    for sampler in ("emcee", "scan"):
        walked = ensemble(posterior, normal, told, found, sampler=sampler)
        assert walked.converged
        assert walked.findings == ()
        assert len(walked.modes) == 1
        assert walked.ridge is None
        assert 0.2 < walked.acceptance < 0.5
        z = walked.draws()
        sds = np.sqrt(np.diag(normal.covariance))
        # four standard errors, and a tenth of an sd for what is not normal
        error = 4 / np.sqrt(walked.convergence.ess) + 0.1
        assert np.all(np.abs(z.mean(axis=0) - normal.z) < error * sds)
        np.testing.assert_allclose(z.std(axis=0), sds, rtol=0.15)


def test_intervals_agree_with_importance_sampling():
    posterior, normal, told, _ = five_solved()
    walked = ensemble(posterior, normal, told)
    weighted = importance(posterior, normal, draws=8000)
    assert weighted.k_hat < 0.7
    one = marginals_of_draws(posterior.parameters, walked.draws())
    other = marginals_of_draws(posterior.parameters, weighted.z, weighted.weights)
    for name in posterior.parameters.names:
        sd = one[name].sd
        for key in ("q05", "q50", "q95"):  # Monte Carlo errors of about 0.04 sd
            assert getattr(one[name], key) == pytest.approx(
                getattr(other[name], key), abs=0.15 * sd
            )


def test_the_mirror_image_of_a_charge_beside_a_line_is_a_mode():
    line = [(-60.0, 0.0), (0.0, 0.0), (60.0, 0.0), (90.0, 0.0)]
    posterior = shot(line, BOTH, truth={"charge_north_m": 20.0})
    starts = [place_of(posterior, charge_north_m=north) for north in (20.0, -20.0)]
    posterior, normal, told, found = solved(posterior, *starts)
    walked = ensemble(posterior, normal, told, found)
    assert walked.converged
    assert len(walked.modes) == 2
    # three thousand effective draws or more: four standard errors
    assert [mode.share for mode in walked.modes] == pytest.approx([0.5, 0.5], abs=0.04)
    assert sorted(np.round(mode.peak[2]) for mode in walked.modes) == [-20.0, 20.0]
    why = all_words(walked.findings)[-1]
    assert "the posterior has 2 modes: " in why
    assert "charge_north_m -" in why
    assert "charge_mass_kg" not in why  # the same in both


def test_a_mass_that_arrivals_far_away_hardly_tell_is_a_ridge_without_end():
    # ln W may fall for ever: arrivals become those of sound
    far = [(150.0, 0.0), (-200.0, 30.0), (0.0, 250.0), (100.0, -150.0)]
    free = ("charge_mass_kg", "origin_time_s")
    posterior = shot(far, (("air_arrival_s", 1e-3),), free)
    posterior, normal, told, found = solved(posterior)
    walked = ensemble(posterior, normal, told, found, most_steps=1500)
    assert not walked.converged
    assert walked.ridge is not None
    assert any(
        "is a ridge" in s and "charge_mass_kg" in s for s in all_words(walked.findings)
    )
    assert any("does not decrease beyond it" in s for s in all_words(walked.findings))


def test_a_null_direction_is_refused_by_name():
    free = ("charge_mass_kg", "charge_east_m", "charge_north_m")
    posterior, normal, told, _ = solved(shot([(60.0, 0.0)], BOTH, free))
    with pytest.raises(InputError, match=r"improper along charge_.*expected a prior"):
        ensemble(posterior, normal, told)


def test_a_density_that_is_no_number_names_the_observation():
    posterior, normal, told, _ = five_solved()
    measured = posterior.measured.at[3].set(jnp.nan)
    broken = eqx.tree_at(lambda p: p.measured, posterior, measured)
    with pytest.raises(InputError, match=r"got NaN for row 4 \(peak_overpressure_pa\)"):
        ensemble(broken, normal, told)
    with pytest.raises(InputError, match=r"got NaN for m1, pressure"):
        ensemble(broken, normal, told, rows=["", "", "", "m1, pressure"])


def test_too_few_walkers_are_refused():
    posterior, normal, told, _ = five_solved()
    with pytest.raises(InputError, match="at least twice the 4 unknowns, got 6"):
        ensemble(posterior, normal, told, walkers=6)


def test_a_walk_cut_short_says_what_is_missing_and_goes_on(tmp_path):
    posterior, normal, told, _ = five_solved()
    short = ensemble(posterior, normal, told, most_steps=150, store=tmp_path / "chain")
    assert not short.converged
    assert any(isinstance(finding, ChainTooShort) for finding in short.findings)
    whole = ensemble(posterior, normal, told)
    rest = ensemble(posterior, normal, told, store=tmp_path / "chain")
    assert rest.resumed == 150
    np.testing.assert_array_equal(rest.z, whole.z)
    nudged = dataclasses.replace(posterior, measured=posterior.measured + 0.1)
    with pytest.raises(InputError, match="its densities differ"):
        ensemble(nudged, normal, told, store=tmp_path / "chain")


def test_progress_counts_up_to_the_end():
    posterior, normal, told, _ = five_solved()
    seen = []
    walked = ensemble(posterior, normal, told, report=seen.append)
    steps = [progress.steps for progress in seen]
    assert steps == sorted(steps)
    last = seen[-1]
    assert last.steps == walked.convergence.steps + walked.convergence.warm_up
    assert last.steps_wanted >= last.steps
    assert "effective samples" in last.words()
    shares = [progress.share() for progress in seen]
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert 0.5 < shares[-1] <= 1.0
