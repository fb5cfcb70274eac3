"""Made-up fits with a place: sensors anywhere, the charge sought among them."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.goodness_of_fit import SuspectedOutlier
from jblast.observations import Observations
from jblast.observations.places import Frame
from jblast.scene import Air, Charge, Scene, Sensor
from jblast.waves.choice import TakenLaw
from tests.report.made_up import PLAIN, estimate, fit_of

BEIRUT = Frame(33.9012, 35.5189, 10.0)


def located(
    sensors,
    draws=None,
    *,
    centre=(0.0, 0.0),
    mass=20.0,
    wind=(0.0, 0.0),
    frame=None,
    residuals=None,
    suspected=(),
    up=0.0,
) -> Fit:
    """A fit of a mass, and of a place where draws of it are given.

    Args:
        sensors: Their places (east, north) [m], a peak each.
        draws: Of the charge's place; None gives it.
        centre: Where it stood by the answer [m].
        mass: Of the charge, known to 20 % [kg].
        wind: Towards east and north [m/s].
        frame: Where that is.
        residuals: One for each sensor [sd].
        suspected: Numbers of sensors that are suspected outliers.
        up: Height of the charge [m].
    """
    sensors = np.asarray(sensors, float)
    n = len(sensors)
    names = tuple(f"m{i + 1}" for i in range(n))
    if residuals is None:
        residuals = np.random.default_rng(8).normal(0.0, 1.3, n)
    residual = np.asarray(residuals, float)
    table = Observations(
        sensor=names,
        quantity=("peak_overpressure_pa",) * n,
        value=np.full(n, 1e3),
        sigma=np.full(n, 50.0),
        position=np.concatenate([sensors, np.full((n, 1), 1.5)], axis=1),
        slant_range=np.full(n, np.nan),
        time=np.full(n, np.nan),
        path=("",) * n,
        shot=("",) * n,
        clock=("",) * n,
        line=tuple(range(2, 2 + n)),
        source="field.csv",
        frame=frame,
    )
    distance = np.hypot(*(sensors - np.array(centre)).T)
    made = table, np.full(n, 1e3), distance, residual, np.full(n, 0.1)
    free, of_place, told = ("charge_mass_kg",), {}, {}
    if draws is not None:
        draws = np.asarray(draws, float)
        for name, column, value in zip(
            ("charge_east_m", "charge_north_m"), draws.T, centre, strict=True
        ):
            of_place[name] = column
            told[name] = estimate(value, float(column.std()))
        free = (*free, *of_place)
    return fit_of(
        made,
        summary=replace(
            PLAIN,
            law={"peak_overpressure_pa": "kingery_bulmash"},
            law_reason={"peak_overpressure_pa": TakenLaw("kingery_bulmash")},
            estimates={"charge_mass_kg": estimate(mass, 0.2 * mass, True), **told},
            free=free,
            n_observations=n,
            suspected_outliers=tuple(
                SuspectedOutlier(names[i], "peak_overpressure_pa", float(residual[i]))
                for i in suspected
            ),
        ),
        scene=Scene(
            Charge(
                mass_kg=mass, position_m=(centre[0], centre[1], up), burst="surface"
            ),
            air=Air(wind_east=wind[0], wind_north=wind[1]),
            sensors=tuple(Sensor(name, jnp.zeros(3)) for name in names),
        ),
        draws=of_place,
    )


def normal_draws(centre, covariance, count=2000, seed=5):
    """Draws of a place."""
    rng = np.random.default_rng(seed)
    return rng.multivariate_normal(centre, covariance, count)


def around(count, radius, seed=2):
    """Sensors about the origin, at up to a radius."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0, 2 * np.pi, count)
    away = radius * np.sqrt(rng.uniform(0.05, 1.0, count))
    return np.stack([away * np.cos(turn), away * np.sin(turn)], axis=-1)


def arc(count=6000, radius=120.0, seed=6):
    """Draws along an arc, as two bearings' clocks leave them."""
    rng = np.random.default_rng(seed)
    turn, away = rng.normal(0.6, 0.5, count), rng.normal(radius, 4.0, count)
    return np.stack([away * np.cos(turn), away * np.sin(turn)], axis=-1)
