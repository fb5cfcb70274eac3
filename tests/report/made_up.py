"""Parts of made-up fits: logs by simple laws, answers, bands."""

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from jblast.inference.fitting.fit import Band, Fit
from jblast.inference.fitting.summary import Summary
from jblast.inference.posterior.parameters import Estimate
from jblast.observations import Observations
from jblast.quantities import TIMES
from jblast.scene import Scene
from jblast.waves.choice import Candidate, Choice, TakenLaw

SOUND = 340.29


def estimate(value, sd=0.0, positive=False) -> Estimate:
    """An estimate, its interval normal (in ln if positive)."""
    if not positive:
        q05, q95 = value - 1.645 * sd, value + 1.645 * sd
        return Estimate(value, sd, math.nan, q05, value, q95)
    q05, q95 = map(float, value * np.exp(np.array([-1.645, 1.645]) * sd / value))
    return Estimate(value, sd, sd / value, q05, value, q95)


def chosen(quantity, law) -> Choice:
    """A choice of a law, the reference at some scaled distances."""
    method = Candidate(law, 0.0, 0.01, 1e-9, valid=True, is_reference=True)
    return Choice(
        quantity=quantity,
        method=law,
        predicted_error=0.01,
        tolerance=0.1,
        met=True,
        cost_s=1e-9,
        candidates=(method,),
        span=(2.1, 38.0),
        reference_uncertainty=0.01,
    )


def taken(quantity, law) -> TakenLaw:
    """A law that was chosen."""
    return TakenLaw(law, chosen(quantity, law))


PLAIN = Summary(
    law={},
    law_reason={},
    law_valid=True,
    law_valid_rows=12,
    estimates={},
    derived={},
    free=(),
    identifiable=True,
    null_directions=(),
    ambiguities=(),
    determined=(),
    posterior="weighted",
    converged=True,
    chi2=9.1,
    dof=9,
    n_observations=12,
    suspected_outliers=(),
    explained_by=(),
    warnings=(),
)
LAWS = {
    "air_arrival_s": lambda r, w: r / SOUND - 1.9e-3 * w ** (1 / 3) * r / (r + 3),
    "peak_overpressure_pa": lambda r, w: 2.1e6 * (r / w ** (1 / 3)) ** -1.5,
    "positive_impulse_pa_s": lambda r, w: 230.0 * w ** (2 / 3) / r,
    "shock_radius_m": lambda t, e: 1.03 * (e / 1.25) ** 0.2 * t**0.4,
}


def log(quantities, distances, mass=200.0, t0=0.0, error=0.06, seed=1, names=None):
    """Observations of several sensors in a row, and the law's value at each."""
    rng = np.random.default_rng(seed)
    rows = [(i, q) for q in quantities for i in range(len(distances))]
    names = names or [f"m{i + 1}" for i in range(len(distances))]
    r = np.array([distances[i] for i, _ in rows], float)
    law = np.array([LAWS[q](x, mass) for (_, q), x in zip(rows, r, strict=True)])
    times = np.array([q in TIMES for _, q in rows])
    sd = np.where(times, 0.02 * law + 1e-4, error)
    noise = sd * rng.standard_normal(len(rows))
    value = np.where(times, law + noise + t0, law * np.exp(noise))
    position = np.stack([r, 0 * r, 0 * r], axis=1)
    radius = np.array([q == "shock_radius_m" for _, q in rows])
    blank = ("",) * len(rows)
    table = Observations(
        sensor=tuple(names[i] for i, _ in rows),
        quantity=tuple(q for _, q in rows),
        value=value,
        sigma=np.where(times, 1e-4, 0.05 * value),
        position=np.where(radius[:, None], np.nan, position),
        slant_range=np.full(len(rows), np.nan),
        time=np.where(radius, r, np.nan),
        path=blank,
        shot=blank,
        clock=blank,
        line=tuple(range(3, 3 + len(rows))),
        source="/home/somebody/logs/quarry.csv",
        comments=("# A made-up log, for tests only.", "# sensors 1.5 m above ground"),
    )
    predicted = np.where(times, law + t0, law)
    return table, predicted, np.where(radius, law, r), noise / sd, sd


def band(quantity, x, mass, log_sd, t0=0.0, axis="range_m", valid=None) -> Band:
    """A band about the law, as wide as the mass is uncertain."""
    law = LAWS[quantity](x, mass)
    low = LAWS[quantity](x, mass * np.exp(-1.645 * log_sd))
    high = LAWS[quantity](x, mass * np.exp(1.645 * log_sd))
    shift = t0 if quantity in TIMES else 0.0
    return Band(
        quantity,
        0,
        axis,
        x + t0 if axis == "time_s" else x,
        np.minimum(low, high) + shift,
        law + shift,
        np.maximum(low, high) + shift,
        np.ones(len(x), bool) if valid is None else valid,
    )


@dataclass(frozen=True)
class MadeFit(Fit):
    """A fit whose bands are made up as well."""

    made_bands: tuple[Band, ...] = ()

    @property
    def bands(self):  # type: ignore  no cache
        """The made bands."""
        return self.made_bands


def fit_of(made, *, scene=None, shared=None, bands=(), **parts) -> Fit:
    """A fit of a made log."""
    table, predicted, distance, residual, sd = made
    answer = SimpleNamespace(
        scene=scene or Scene(),
        predicted=predicted,
        slant_range=distance,
        residual=residual,
        sd=sd,
        shared=np.zeros(len(table)) if shared is None else shared,
    )
    density = SimpleNamespace(layout=SimpleNamespace(shot=(0,) * len(table)))
    solution: Any = SimpleNamespace(answer=answer, density=density)
    return MadeFit(observations=table, solution=solution, made_bands=bands, **parts)


def changed(fit: Fit, *, bands=None, **of_answer) -> Fit:
    """The same fit with other parts of its answer, or other bands."""
    answer = SimpleNamespace(**{**vars(fit.answer), **of_answer})
    solution: Any = SimpleNamespace(**{**vars(fit.solution), "answer": answer})
    made = fit.bands if bands is None else bands
    changes: dict[str, Any] = {"solution": solution, "made_bands": made}
    return replace(fit, **changes)
