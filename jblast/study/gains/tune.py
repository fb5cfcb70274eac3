r"""Gains of the hold by gradient through a scene's blasts, within stability margins.

Eight numbers are looked for, nine if the motors may be led (`allocation.led`): by what
factor, in ln, position, velocity and integral gain sideways and upwards, and those of
attitude and body rate, differ from the scene's. What is made least is half the mean
over drawn blasts of ln of the peak deviation, half ln of their 8-norm, for the
strongest; each peak is smooth (`flights.smooth_peaks`) and differentiated backwards
through every step of its flight. Half the mean of ln of the 2-norm of the path error
over time is added, for a vehicle that is hardly thrown may take its time on the way
back; much of any peak that is higher than with the scene's gains; and a thousandth of
the squares of the factors, so that what does not matter stays. The margins of all
loops are constraints, with derivatives of their own. Sequential quadratic programming
(Kraft 1988, SciPy's SLSQP) goes from the scene's gains, whose margins may be too small,
to the nearest optimum.

The flights tuned by are in steps of the semi-implicit Euler rule, whose program is a
third of RK4's, and few of many drawn (`tuning_flights.py`). Of the best gains that the
search came by, those are answered by which the many do best, none of them going further
than all do with the scene's, if there are such. The unseen ones are flown as `jblast
fly` does. Blasts by which the scene's own gains crash are left out of the tuning, not
of the judgement.
"""

from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.optimize import OptimizeResult, minimize

from jblast.errors import InputError
from jblast.progress import in_words
from jblast.scene import UncertainScene, VehicleSpec
from jblast.study.flights.draws import checked_scene
from jblast.study.flights.records import Options
from jblast.study.gains.flights import drawn_flights, outcomes_of
from jblast.study.gains.objective import (
    FACTORS,
    margins_to_spare,
    mean_ln_peak,
    scaled,
)
from jblast.study.gains.records import Tried, TunedGains, Wish
from jblast.study.gains.tuning_flights import FLOWN, TuningFlights, tuning_flights
from jblast.vehicle import STEP_S, Gains, hold_of, vehicle_of
from jblast.vehicle.control.stability import hold_margins, is_stable

MOST_STEPS, LARGEST = 60, np.log(30.0)
"""Of the search, and of a factor in ln."""
CANDIDATES = 12
"""Of the search's best, among which the many flights choose."""
UNSEEN_SEEDS = 1_000_003
"""Between the seed of the blasts tuned by and that of the unseen ones."""
SLACK = 0.002
"""By what the search keeps off the margins, as a share of them."""


def tune_gains(uncertain: UncertainScene, wish: Wish | None = None) -> TunedGains:
    """Tune the gains of a scene's hold to its blasts.

    Args:
        uncertain: The scene; what has a prior is drawn from it.
        wish: Margins, numbers and seed; None: the defaults.

    Returns:
        Gains before and after, their margins, and flights through unseen blasts.

    Raises:
        InputError: The scene cannot be flown, a number cannot be used, no flight stays
            up to be tuned by, or no gains with such margins are found.
    """
    wish = Wish() if wish is None else wish
    spec = _checked(uncertain, wish)
    gains = hold_of(spec, integral=spec.integral is not False).gains
    vehicle = vehicle_of(spec)
    lag, dead = float(vehicle.motor_lag_s), STEP_S / 2 + wish.delay_s
    now = in_words()
    now("drawing blasts, flown with the scene's gains")
    flights = tuning_flights(uncertain, spec, gains, wish.vehicles, wish.seed, lag)
    bounds = [(-LARGEST, LARGEST)] * (FACTORS - 1) + [_lead_bounds(gains, wish)]
    led = gains
    if wish.motor_lead > 1 and gains.motor_lead is None:
        led = replace(gains, motor_lead=gains.lead)

    seen: list[tuple[float, np.ndarray]] = []

    def peak(x: np.ndarray) -> tuple[float, np.ndarray]:
        (value, _), slope = _PEAK(jnp.asarray(x), led, flights.few, flights.ln_few)
        seen.append((float(value), np.array(x)))
        now(f"{wish.vehicles} blasts flown with slopes, {len(seen)} times")
        if not np.isfinite(value):
            return 10.0, np.zeros(FACTORS)
        return float(value), np.nan_to_num(np.asarray(slope))

    asked = jnp.asarray([wish.margin_db, wish.margin_deg])

    def room(x: np.ndarray) -> np.ndarray:
        return np.asarray(_ROOM(jnp.asarray(x), led, lag, dead, asked)) - SLACK

    def slopes(x: np.ndarray) -> np.ndarray:
        return np.asarray(_SLOPES(jnp.asarray(x), led, lag, dead, asked))

    def search(least: Callable, start: np.ndarray, tolerance: float) -> OptimizeResult:
        return minimize(
            least,
            start,
            jac=True,
            method="SLSQP",
            bounds=bounds,
            constraints=[{"type": "ineq", "fun": room, "jac": slopes}],
            options={"maxiter": MOST_STEPS, "ftol": tolerance},
        )

    # from the nearest gains with the margins, where the scene's have less
    start = np.zeros(FACTORS)
    if (room(start) < 0).any():
        start = search(lambda x: (float(x @ x), 2 * x), start, 1e-6).x
        if (room(start) < -SLACK).any():
            raise InputError(_unreachable(uncertain, wish, gains, lag, dead))
    peak(start)
    found = search(peak, start, 2e-4)
    allowed = [
        (value, x)
        for value, x in seen
        if np.isfinite(value)
        and (room(x) >= -SLACK).all()
        and is_stable(scaled(led, jnp.asarray(x)), lag, STEP_S)
    ]
    if not allowed:
        raise InputError(_unreachable(uncertain, wish, gains, lag, dead))
    now(f"choosing by {flights.many.count} blasts")
    best = _chosen(allowed, led, flights)
    best = _rounded(scaled(led, jnp.asarray(best)))
    now(f"flying {wish.unseen} unseen blasts")
    seed = wish.seed + UNSEEN_SEEDS
    unseen, notes = drawn_flights(uncertain, spec, wish.unseen, seed, Options())
    before, after = (
        Tried(one, hold_margins(one, lag, dead), outcomes_of(one, unseen))
        for one in (gains, best)
    )
    return TunedGains(
        vehicle=spec,
        wish=wish,
        before=before,
        after=after,
        ln_peaks=tuple(value for value, _ in seen),
        converged=bool(found.success),
        notes=notes,
    )


def _rounded(gains: Gains) -> Gains:
    """Return gains in four digits: those that are printed are those that are judged."""

    def few(value: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
        return np.array([float(f"{x:.4g}") for x in value.ravel()]).reshape(value.shape)

    return jax.tree.map(lambda x: jnp.asarray(few(np.asarray(x))), gains)


def _lead_bounds(gains: Gains, wish: Wish) -> tuple[float, float]:
    """Return the bounds of the factor, in ln, on the motors' lead."""
    if wish.motor_lead <= 1:
        return 0.0, 0.0
    own = float(gains.lead)
    return -np.log(own), max(np.log(wish.motor_lead / own), 0.0)


def _chosen(
    allowed: list[tuple[float, np.ndarray]], gains: Gains, flights: TuningFlights
) -> np.ndarray:
    """Return the factors by which the many flights do best, none worse if may be."""
    judged = []
    for _, x in sorted(allowed, key=lambda one: one[0])[:CANDIDATES]:
        value, (peaks, _) = FLOWN(jnp.asarray(x), gains, flights.many, flights.ln_many)
        further = not bool(peaks.max() <= flights.ln_many.max())
        judged.append((further, np.nan_to_num(float(value), nan=np.inf), x))
    return min(judged, key=lambda one: one[:2])[2]


_PEAK = eqx.filter_jit(jax.value_and_grad(mean_ln_peak, has_aux=True))
_ROOM = eqx.filter_jit(margins_to_spare)
_SLOPES = eqx.filter_jit(jax.jacfwd(margins_to_spare))


def _checked(uncertain: UncertainScene, wish: Wish) -> VehicleSpec:
    """Return the vehicle of a scene whose gains can be tuned."""
    if wish.vehicles < 2:
        raise InputError(
            "vehicles: expected two blasts and more to tune gains by, got "
            f"{wish.vehicles}"
        )
    for name, value in (
        ("margin-db", wish.margin_db),
        ("margin-deg", wish.margin_deg),
    ):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{name}: expected a positive number, got {value:g}")
    if not (np.isfinite(wish.motor_lead) and wish.motor_lead >= 1):
        raise InputError(
            f"motor-lead: expected a factor of 1 and more, got {wish.motor_lead:g}"
        )
    if not (np.isfinite(wish.delay_s) and wish.delay_s >= 0):
        raise InputError(f"delay: expected a time of 0 s or more, got {wish.delay_s:g}")
    return checked_scene(uncertain, wish.vehicles, by_profile=False)


def _unreachable(
    uncertain: UncertainScene, wish: Wish, gains: Gains, lag: float, dead: float
) -> str:
    margins = hold_margins(gains, lag, dead)
    gain, phase = float(margins.gain_db.min()), float(margins.phase_deg.min())
    return (
        f"{uncertain.source or 'scene'}: expected margins that gains can have, got "
        f"{wish.margin_db:g} dB and {wish.margin_deg:g} degrees, with which none were "
        f"found; the scene's own have {gain:.3g} dB and {phase:.3g} degrees at motors "
        f"that lag by {lag:g} s and a dead time of {dead:.3g} s"
    )
