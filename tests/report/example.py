"""Made-up fits: what a report has to cope with, without running any inference."""

import math
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.wrong import SuspectedOutlier
from jblast.inference.identify import (
    Cure,
    EstimableCombination,
    NullDirection,
    OtherMode,
    ResolvingDatum,
)
from jblast.inference.posterior.parameters import Estimate
from jblast.results import warning
from jblast.scene import Charge, Scene, Sensor
from jblast.waves.choice import TakenLaw
from tests.report.made_up import (
    PLAIN,
    SOUND,
    band,
    changed,
    estimate,
    fit_of,
    log,
    taken,
)

REASONS = {
    quantity: taken(quantity, "kingery_bulmash")
    for quantity in ("air_arrival_s", "peak_overpressure_pa")
}


def three_parameters() -> Fit:
    """A good fit of mass, origin time and sound speed, two quantities."""
    r = np.geomspace(12.0, 230.0, 6)
    t0, mass = 0.4123, 209.0
    made = log(["air_arrival_s", "peak_overpressure_pa"], r, mass, t0)
    rng = np.random.default_rng(3)
    x = np.geomspace(10.0, 280.0, 80)
    draws = rng.multivariate_normal(
        [np.log(mass), t0, np.log(SOUND)],
        [[0.16**2, 8e-5, -4e-4], [8e-5, 8e-4**2, -2e-6], [-4e-4, -2e-6, 0.006**2]],
        size=2000,
        check_valid="ignore",
    )
    return fit_of(
        made,
        summary=replace(
            PLAIN,
            law=dict.fromkeys(REASONS, "kingery_bulmash"),
            law_reason=REASONS,
            estimates={
                "charge_mass_kg": estimate(mass, 33.4, True),
                "origin_time_s": estimate(t0, 8e-4),
                "air_sound_speed_m_s": estimate(SOUND, 2.04, True),
            },
            derived={
                "charge_tnt_mass_kg": estimate(mass, 33.4, True),
                "charge_energy_j": estimate(mass * 4.184e6, 33.4 * 4.184e6, True),
            },
            free=("charge_mass_kg", "origin_time_s", "air_sound_speed_m_s"),
        ),
        scene=Scene(
            Charge(mass_kg=mass, time_s=t0),
            sensors=tuple(Sensor(f"m{i}", jnp.zeros(3)) for i in range(1, 7)),
        ),
        draws={
            "charge_mass_kg": np.exp(draws[:, 0]),
            "origin_time_s": draws[:, 1],
            "air_sound_speed_m_s": np.exp(draws[:, 2]),
        },
        bands=tuple(band(q, x, mass, 0.16, t0) for q in REASONS),
    )


def one_parameter() -> Fit:
    """A poor fit of the mass alone, from impulses, past the range of its law."""
    r = np.array([1150.0, 1320.0, 1600.0, 1900.0, 2400.0])
    made = log(["positive_impulse_pa_s"], r, 1000.0, error=0.12)
    x = np.linspace(1000.0, 2600.0, 60)
    rng = np.random.default_rng(5)
    return fit_of(
        made,
        summary=replace(
            PLAIN,
            law={"positive_impulse_pa_s": "ford_2021"},
            law_reason={
                "positive_impulse_pa_s": taken("positive_impulse_pa_s", "ford_2021")
            },
            law_valid=False,
            estimates={"charge_mass_kg": estimate(1000.0, 620.0, True)},
            free=("charge_mass_kg",),
            chi2=41.0,
            dof=4,
            n_observations=5,
            warnings=(warning("look_closer", log="quarry.csv"),),
        ),
        scene=Scene(Charge(mass_kg=1000.0)),
        draws={"charge_mass_kg": 1000.0 * np.exp(0.62 * rng.standard_normal(1500))},
        bands=(band("positive_impulse_pa_s", x, 1000.0, 0.2, valid=x < 1700.0),),
    )


def not_identifiable() -> Fit:
    """Arrivals alone by Wu-Hao: mass and sound speed move along (1, -0.2)."""
    r = np.geomspace(10.0, 50.0, 8)
    made = log(["air_arrival_s"], r, 15.0, names=[f"gauge {i}" for i in range(8)])
    x = np.geomspace(9.0, 60.0, 50)
    return fit_of(
        made,
        summary=replace(
            PLAIN,
            law={"air_arrival_s": "wu_hao"},
            law_reason={"air_arrival_s": TakenLaw("wu_hao")},
            estimates={
                "charge_mass_kg": Estimate(),
                "air_sound_speed_m_s": Estimate(),
                "origin_time_s": estimate(0.0001, 4e-4),
            },
            derived={"charge_energy_j": Estimate()},
            free=("charge_mass_kg", "air_sound_speed_m_s", "origin_time_s"),
            identifiable=False,
            null_directions=(
                NullDirection(
                    {"charge_mass_kg": 1.0, "air_sound_speed_m_s": -0.2},
                    "ln",
                    Cure(
                        ("charge_mass_kg", "air_sound_speed_m_s"),
                        (ResolvingDatum("peak_overpressure_pa", "range"),),
                    ),
                ),
            ),
            determined=(
                EstimableCombination(
                    "0.2 ln charge_mass_kg + ln air_sound_speed_m_s", 6.37128, 0.0051
                ),
            ),
            dof=6,
            n_observations=8,
        ),
        scene=Scene(Charge(mass_kg=15.0)),
        draws={"origin_time_s": np.random.default_rng(0).normal(1e-4, 4e-4, 800)},
        bands=(band("air_arrival_s", x, 15.0, 0.05),),
    )


def shock_radius() -> Fit:
    """Like Trinity: energy and gamma from the radius of the shock against time."""
    t = np.geomspace(1e-4, 0.062, 24)
    energy = 8.8e13
    made = log(["shock_radius_m"], t, energy, error=0.02, names=["camera"] * 24)
    x = np.geomspace(8e-5, 0.08, 60)
    rng = np.random.default_rng(2)
    z = rng.multivariate_normal([0, 0], [[1.0, -0.8], [-0.8, 1.0]], 1500)
    mass = energy / 4.184e6
    return fit_of(
        made,
        summary=replace(
            PLAIN,
            law={"shock_radius_m": "sedov_taylor"},
            law_reason={"shock_radius_m": TakenLaw("sedov_taylor")},
            estimates={
                "charge_mass_kg": estimate(mass, 0.12 * mass, True),
                "sedov_gamma": estimate(1.31, 0.04, True),
            },
            derived={"charge_energy_j": estimate(energy, 0.12 * energy, True)},
            free=("charge_mass_kg", "sedov_gamma"),
            chi2=20.3,
            dof=22,
            n_observations=24,
            posterior="emcee",
        ),
        scene=Scene(Charge(mass_kg=mass)),
        draws={
            "charge_mass_kg": mass * np.exp(0.12 * z[:, 0]),
            "sedov_gamma": 1.31 + 0.04 * z[:, 1],
        },
        bands=(band("shock_radius_m", x, energy, 0.12, axis="time_s"),),
    )


def with_outliers() -> Fit:
    """The three-parameter fit with one wild pressure, from a sensor with a bad name."""
    fit = three_parameters()
    table, row = fit.observations, 9
    names = list(table.sensor)
    names[row] = NASTY
    value, residual = table.value.copy(), fit.residual.copy()
    value[row] *= 2.4
    residual[row] += np.log(2.4) / fit.sd[row]
    outlier = SuspectedOutlier(NASTY, "peak_overpressure_pa", float(residual[row]))
    other = {"charge_mass_kg": 340.0, "origin_time_s": 0.4101}
    fit = changed(fit, residual=residual)
    return replace(
        fit,
        summary=replace(
            fit.summary,
            suspected_outliers=(outlier,),
            ambiguities=(
                OtherMode(
                    other,
                    ("charge_mass_kg", "origin_time_s"),
                    0.2,
                    ResolvingDatum("air_arrival_s", "aside"),
                ),
            ),
            identifiable=False,
        ),
        observations=replace(table, sensor=tuple(names), value=value),
    )


NASTY = "<script>alert('$x')</script>"


def no_draws() -> Fit:
    """A fit that did not converge: no draws, no bands, NaN where numbers should be."""
    nothing = np.full(5, np.nan)
    fit = changed(one_parameter(), bands=(), predicted=nothing, residual=nothing)
    return replace(
        fit,
        summary=replace(
            fit.summary,
            estimates={"charge_mass_kg": Estimate()},
            converged=False,
            chi2=math.nan,
            dof=0,
        ),
        draws={},
    )


EVERY = (
    three_parameters,
    one_parameter,
    not_identifiable,
    shock_radius,
    with_outliers,
    no_draws,
)
