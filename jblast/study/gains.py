"""Gains of a position controller tuned by gradient, within stability margins.

The unknowns are the logarithms of eight factors on the scene's gains: of position,
velocity and integral gain sideways and upwards, and of the attitude and body-rate
gains. The objective is half the mean, over sampled blasts, of ln of the peak deviation,
plus half ln of the 8-norm of these peaks, which weighs the strongest. Each peak is
smooth (`smooth_peaks`) and differentiated in reverse mode through every step of its
flight. Three terms are added: half the mean of ln of the 2-norm of the path error over
time, because a vehicle that is displaced little may return slowly; a large penalty on
any peak above that of the scene's gains; and a thousandth of the squared factors, so
that gains without influence stay. Constraints are the margins of all loops, with their
own derivatives, and the decay of the closed loop: some unstable loops have these
margins too, and grow too slowly for a flight to show it. Sequential quadratic
programming (Kraft 1988, SciPy's SLSQP) searches from the scene's gains, whose margins
may be too small, to the nearest local optimum.

The flights of the search are a few of many sampled flights. Of the best gains found,
the result is the set with the best value over the many flights, among those whose
largest peak does not exceed the largest with the scene's gains, if there are any.
Unseen flights are computed as by `jblast fly`. Blasts that crash the vehicle with the
scene's own gains are left out of the tuning, but not out of the evaluation.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy.optimize import OptimizeResult, minimize

from jblast.errors import InputError, argument, require
from jblast.progress import in_words
from jblast.scene import UncertainScene, VehicleSpec
from jblast.study.flight_results import (
    FlightLoad,
    Options,
    arrival_at,
    burst_remarks,
    load_of,
)
from jblast.study.flights import (
    GROUND_UP_M,
    checked_scene,
    drawn_scenes,
    flight_seconds,
)
from jblast.vehicle import (
    STEP_S,
    FlightMetrics,
    Gust,
    State,
    Trajectory,
    Vehicle,
    controller_of,
    flight_metrics,
    path_error,
    simulate,
    start_of,
    vehicle_of,
)
from jblast.vehicle.control.position_hold import Gains
from jblast.vehicle.control.stability import Margins, decay_rate, hold_margins
from jblast.vehicle.controllers import gains_controller
from jblast.vehicle.from_scene import wind_of

MAX_STEPS = 60
"""Limit of the steps of the search; the best gains so far are used beyond it."""
MAX_LN_FACTOR = np.log(30.0)
"""Bound of a factor in ln, far beyond those at which the margins constrain the
search."""
CANDIDATES = 12
"""Best gains of the search that are compared over all sampled flights."""
UNSEEN_SEED_OFFSET = 1_000_003
"""Offset of the unseen blasts' seed, a prime that no user's seeds are apart by."""
SLACK = 0.002
"""Relative distance of the search from the margins: SLSQP violates constraints a
little, and four printed digits round the gains."""
DECAY_STEP = 1e-6
"""Step of the differences of the decay rate, in ln of a gain: an eigenvalue is exact to
1e-15, so that both errors of its slope are about 1e-6."""
SAMPLED_PER_FLIGHT, STRONGEST_SHARE = 8, 4
"""Sampled flights for each flight of the search. One in `STRONGEST_SHARE` flights of
the search has one of the highest peaks; the others represent all at even ranks."""
TUNING_STEP_S = 1e-3
"""Longest time step: twice that of `jblast fly`, and half the cost of a gradient."""
FLIGHT_EXTENSION_S = -2.0
"""Duration relative to `jblast fly`: 3 s after the last blast contain its peak."""
FACTORS = 8
"""Factors of a search."""
PEAK_NORM, FLIGHT_NORM = 24.0, 8.0
"""Powers of the norms over the rows of a flight, and over flights.

With the power 24 a peak of 0.1 s counts with 91 % of its height, and is differentiable.
With the power 8 all strong flights count, not the strongest alone.
"""
RIDGE_WEIGHT, RETURN_WEIGHT = 1e-3, 0.5
"""Weights of the squared factors, and of the path error over time."""
EXCESS_WEIGHT = 64.0
"""Weight of the mean square by which ln of a peak exceeds that of the scene's gains."""
SUFFICIENT = 3.0
"""Multiple of a required margin beyond which the margin has no slope for the search:
far from its limit it is irrelevant, and may be infinite."""
ROW_S = 0.01
"""Time between stored rows: a peak lasts a tenth of a second or more."""


class Outcomes(eqx.Module):
    """Results of flights with one set of gains.

    Attributes:
        metrics: Metrics from the first blast on.
        time_s: Times of the rows [s].
        error_m: Path error at each row [m].
    """

    metrics: FlightMetrics
    time_s: Float[Array, " time"]
    error_m: Float[Array, "flight time"]

    @property
    def peaks_m(self) -> Float[np.ndarray, " flight"]:
        """Peak deviations [m]."""
        return np.asarray(self.metrics.peak_deviation_m)

    @property
    def flies_on(self) -> Bool[np.ndarray, " flight"]:
        """Vehicles that neither crashed nor diverged."""
        return ~np.asarray(self.metrics.crashed)


@dataclass(frozen=True)
class EvaluatedGains:
    """Gains with their stability margins and their flights through unseen blasts.

    Attributes:
        gains: Gains of the position controller.
        margins: Margins of each loop of `vehicle.control.stability.LOOPS`.
        outcomes: Results with the unseen blasts.
    """

    gains: Gains
    margins: Margins
    outcomes: Outcomes

    @property
    def gain_margin_db(self) -> float:
        """Smallest gain margin of all loops, upwards or downwards [dB]."""
        return float(np.min(np.asarray(self.margins.gain_db)))

    @property
    def phase_margin_deg(self) -> float:
        """Smallest phase margin of all loops [degrees]."""
        return float(np.min(np.asarray(self.margins.phase_deg)))


@dataclass(frozen=True)
class TuningSettings:
    """Settings of the tuning of gains.

    Attributes:
        margin_db: Minimum gain margin, upwards and downwards [dB].
        margin_deg: Minimum phase margin [degrees].
        delay_s: Additional loop delay by sensors and computation [s], included in the
            margins but not in the flights.
        vehicles: Number of blasts of the search.
        unseen: Number of blasts of the evaluation.
        seed: Seed of the blasts.
        controller: Name in `vehicle.CONTROLLERS` of a controller with the loops of the
            SE(3) position controller; None for that of the scene.
    """

    margin_db: float = 6.0
    margin_deg: float = 35.0
    delay_s: float = 0.0
    vehicles: int = 32
    unseen: int = 200
    seed: int = 0
    controller: str | None = None


@dataclass(frozen=True)
class TunedGains:
    """Gains before and after tuning.

    Attributes:
        vehicle: Vehicle section of the scene.
        settings: Settings of the tuning.
        before: Gains of the scene.
        after: Tuned gains.
        ln_peaks: Objective (module docstring) at each evaluation of the search.
        converged: Whether the search converged.
        notes: Remarks on the curve sets of the blasts.
    """

    vehicle: VehicleSpec
    settings: TuningSettings
    before: EvaluatedGains
    after: EvaluatedGains
    ln_peaks: tuple[float, ...]
    converged: bool
    notes: tuple[str, ...] = ()

    def cut(self, share: float = 0.5) -> float:
        """Return the relative reduction of a quantile of the peak deviation.

        It is NaN where the quantile with the scene's gains is 0 or infinite.
        """
        before, after = (
            float(np.quantile(known_peaks(one), share))
            for one in (self.before, self.after)
        )
        return 1.0 - after / before if 0 < before < np.inf else np.nan


def keys_of_gains(gains: Gains) -> dict[str, float | tuple[float, ...]]:
    """Return gains by the names of `[vehicle] control`, rounded to four digits."""
    keys: dict[str, float | tuple[float, ...]] = {
        "kp_pos": tuple(map(few, gains.position)),
        "kd_pos": tuple(map(few, gains.velocity)),
    }
    if np.any(np.asarray(gains.integral) > 0):
        keys["ki_pos"] = tuple(map(few, gains.integral))
    keys |= {"kp_att": few(gains.attitude), "kd_att": few(gains.body_rate)}
    if gains.motor_lead is not None:
        keys["motor_lead"] = few(gains.motor_lead)
    return keys


def tune_gains(
    uncertain: UncertainScene, settings: TuningSettings | None = None
) -> TunedGains:
    """Tune the gains of a scene's position controller to its blasts.

    Args:
        uncertain: Scene; parameters with a prior are sampled.
        settings: Margins, numbers and seed; None for the defaults.

    Returns:
        Gains before and after, their margins, and flights through unseen blasts.

    Raises:
        InputError: The scene cannot be flown, a setting is invalid, each flight
            crashes with the scene's gains, or no gains with the margins are found.
    """
    settings = TuningSettings() if settings is None else settings
    spec = _checked(uncertain, settings)
    own = "without_integral" if spec.integral is False else "with_integral"
    controller = own if settings.controller is None else settings.controller
    gains_controller(controller)  # rejects a controller with other loops
    gains = controller_of(spec, controller).gains
    vehicle = vehicle_of(spec)
    lag, dead = float(vehicle.motor_lag_s), STEP_S / 2 + settings.delay_s
    now = in_words()
    now("sampling blasts, flown with the scene's gains")
    flights = tuning_flights(
        uncertain, spec, gains, settings.vehicles, settings.seed, lag, controller
    )
    seen: list[tuple[float, np.ndarray]] = []

    def peak(x: np.ndarray) -> tuple[float, np.ndarray]:
        (value, _), slope = _PEAK(jnp.asarray(x), gains, flights.few, flights.ln_few)
        seen.append((float(value), np.array(x)))
        now(f"{settings.vehicles} blasts flown with gradients, {len(seen)} times")
        if not np.isfinite(value):
            # a crash has no slope: a large value, from which the line search steps back
            return 10.0, np.zeros(FACTORS)
        return float(value), np.nan_to_num(np.asarray(slope))

    required = jnp.asarray([settings.margin_db, settings.margin_deg])

    def decay(x: np.ndarray) -> float:
        return decay_rate(scaled(gains, jnp.asarray(x)), lag, STEP_S)

    def spare(x: np.ndarray) -> np.ndarray:
        margins = np.asarray(_SPARE(jnp.asarray(x), gains, lag, dead, required))
        return np.append(margins - SLACK, decay(x))

    def slopes(x: np.ndarray) -> np.ndarray:
        margins = np.asarray(_SLOPES(jnp.asarray(x), gains, lag, dead, required))
        steps = DECAY_STEP * np.eye(FACTORS)
        falls = [(decay(x + step) - decay(x)) / DECAY_STEP for step in steps]
        return np.vstack([margins, falls])

    def search(least: Callable, start: np.ndarray, tolerance: float) -> OptimizeResult:
        return minimize(
            least,
            start,
            jac=True,
            method="SLSQP",
            bounds=[(-MAX_LN_FACTOR, MAX_LN_FACTOR)] * FACTORS,
            constraints=[{"type": "ineq", "fun": spare, "jac": slopes}],
            options={"maxiter": MAX_STEPS, "ftol": tolerance},
        )

    # SLSQP needs a feasible start: the nearest gains with the margins
    start = np.zeros(FACTORS)
    if (spare(start) < 0).any():
        start = search(lambda x: (float(x @ x), 2 * x), start, 1e-6).x
        if (spare(start) < -SLACK).any():
            raise InputError(_unreachable(uncertain, settings, gains, lag, dead))
    # the start is a candidate: the search may find nothing better
    peak(start)
    found = search(peak, start, 2e-4)
    allowed = [
        (value, x)
        for value, x in seen
        if np.isfinite(value) and (spare(x) >= -SLACK).all() and decay(x) >= 0
    ]
    if not allowed:
        raise InputError(_unreachable(uncertain, settings, gains, lag, dead))
    now(f"comparing over {flights.many.count} blasts")
    best = _chosen(allowed, gains, flights)
    best = _rounded(scaled(gains, jnp.asarray(best)))
    now(f"flying {settings.unseen} unseen blasts")
    # other samples: on those of the search the gains would look too good
    seed = settings.seed + UNSEEN_SEED_OFFSET
    unseen, notes = drawn_flights(
        uncertain, spec, settings.unseen, seed, Options(), controller
    )
    before, after = (
        EvaluatedGains(one, hold_margins(one, lag, dead), outcomes_of(one, unseen))
        for one in (gains, best)
    )
    return TunedGains(
        vehicle=spec,
        settings=settings,
        before=before,
        after=after,
        ln_peaks=tuple(value for value, _ in seen),
        converged=bool(found.success),
        notes=notes,
    )


def _rounded(gains: Gains) -> Gains:
    """Return gains rounded to the four printed digits, which are then evaluated."""
    return jax.tree.map(lambda x: jnp.asarray(np.vectorize(few)(x)), gains)


def few(value: Any) -> float:
    """Return four digits: finer than any effect on the margins, and short in a file."""
    return float(f"{float(value):.4g}")


class DrawnFlights(eqx.Module):
    """Flights of one vehicle, each through its own blasts.

    Attributes:
        load: Loads of the blasts, with a leading axis of flights.
        wind: Velocity of the air, east, north, up [m/s].
        arrival_s: Arrival of the first blast at the target position [s].
        start: Initial state.
        vehicle: Vehicle of all flights.
        target_m: Target position [m].
        yaw_rad: Target heading [rad].
        seconds: Duration of each flight [s].
        options: Options of the flights.
        controller: Name in `vehicle.CONTROLLERS`.
    """

    load: FlightLoad
    wind: Float[Array, "flight 3"]
    arrival_s: Float[Array, " flight"]
    start: State
    vehicle: Vehicle
    target_m: Float[Array, "3"]
    yaw_rad: Float[Array, ""]
    seconds: float = eqx.field(static=True)
    options: Options = eqx.field(static=True)
    controller: str = eqx.field(static=True, default="with_integral")

    @property
    def count(self) -> int:
        """Number of flights."""
        return self.arrival_s.shape[0]


class TuningFlights(NamedTuple):
    """Flights of the search, and flights of the comparison of its best gains.

    Attributes:
        few: Flights with gradients, at each step of the search.
        ln_few: ln of the peak deviation of each with the scene's gains.
        many: Flights of the comparison.
        ln_many: ln of the peak deviation of each with the scene's gains.
    """

    few: DrawnFlights
    ln_few: Float[Array, " few"]
    many: DrawnFlights
    ln_many: Float[Array, " many"]


def _chosen(
    allowed: list[tuple[float, np.ndarray]], gains: Gains, flights: TuningFlights
) -> np.ndarray:
    """Return the best factors over all flights, without a larger peak if possible."""
    judged = []
    for _, x in sorted(allowed, key=lambda one: one[0])[:CANDIDATES]:
        value, (peaks, _) = FLOWN(jnp.asarray(x), gains, flights.many, flights.ln_many)
        worse = not bool(peaks.max() <= flights.ln_many.max())
        judged.append((worse, np.nan_to_num(float(value), nan=np.inf), x))
    # arrays do not compare: the factors are not part of the key
    return min(judged, key=lambda one: one[:2])[2]


def mean_ln_peak(
    factors: Float[Array, "8"],
    gains: Gains,
    flights: DrawnFlights,
    ln_before: Float[Array, " flight"],
) -> tuple[Float[Array, ""], tuple[Float[Array, " flight"], Bool[Array, " flight"]]]:
    """Return the objective; and of each flight ln of its peak, and whether it crashes.

    Args:
        factors: Factors in ln, as in `scaled`.
        gains: Gains of the scene.
        flights: Flights of the search.
        ln_before: ln of the peak of each flight with the scene's gains.
    """
    trajectory = flown_with(scaled(gains, factors), flights)
    peaks = smooth_peaks(trajectory, flights, PEAK_NORM)
    metrics = flight_metrics(
        # metrics have no useful gradients: do not differentiate through them
        jax.lax.stop_gradient(trajectory),
        flights.target_m,
        flights.arrival_s,
        ground_up_m=GROUND_UP_M,
    )
    # a norm over the flights: a maximum with gradients
    strongest = jax.nn.logsumexp(FLIGHT_NORM * peaks) - jnp.log(peaks.size)
    middle = (jnp.mean(peaks) + strongest / FLIGHT_NORM) / 2
    back = RETURN_WEIGHT * jnp.mean(smooth_peaks(trajectory, flights, 2.0))
    # one-sided: a lower peak elsewhere does not pay for a higher one here
    more = jnp.maximum(peaks - ln_before, 0)
    worse = EXCESS_WEIGHT * jnp.mean(more * more)
    least = middle + back + worse + RIDGE_WEIGHT * jnp.sum(factors**2)
    return least, (peaks, metrics.crashed)


_PEAK = eqx.filter_jit(jax.value_and_grad(mean_ln_peak, has_aux=True))


def margins_to_spare(
    factors: Float[Array, "8"],
    gains: Gains,
    motor_lag_s: float,
    dead_time_s: float,
    required: Float[Array, "2"],
) -> Float[Array, " loop_margin"]:
    """Return the margins relative to the required gain [dB] and phase [deg], less 1."""
    margins = hold_margins(scaled(gains, factors), motor_lag_s, dead_time_s)
    shares = [
        margins.up_db / required[0],
        margins.down_db / required[0],
        margins.phase_deg / required[1],
    ]
    return jnp.minimum(jnp.concatenate(shares), SUFFICIENT) - 1.0


_SPARE = eqx.filter_jit(margins_to_spare)
_SLOPES = eqx.filter_jit(jax.jacfwd(margins_to_spare))


def _checked(uncertain: UncertainScene, settings: TuningSettings) -> VehicleSpec:
    """Return the vehicle section of a scene, after a check of the settings."""
    count, delay_s = settings.vehicles, settings.delay_s
    words = "two blasts or more to tune gains"
    require(count >= 2, argument("vehicles"), words, count)
    for name in ("margin_db", "margin_deg"):
        value = getattr(settings, name)
        positive = np.isfinite(value) and value > 0
        require(positive, argument(name), "a positive number", f"{value:g}")
    known = np.isfinite(delay_s) and delay_s >= 0
    require(known, argument("delay"), "a time of 0 s or more", f"{delay_s:g}")
    return checked_scene(uncertain, settings.vehicles, by_profile=False)


def _unreachable(
    uncertain: UncertainScene,
    settings: TuningSettings,
    gains: Gains,
    lag: float,
    dead: float,
) -> str:
    margins = hold_margins(gains, lag, dead)
    gain, phase = float(margins.gain_db.min()), float(margins.phase_deg.min())
    return (
        f"{uncertain.source or 'scene'}: expected attainable margins, got "
        f"{settings.margin_db:g} dB and {settings.margin_deg:g} degrees; the scene's "
        f"gains have {gain:.3g} dB and {phase:.3g} degrees with a motor lag of {lag:g} "
        f"s and a dead time of {dead:.3g} s"
    )


def tuning_flights(
    uncertain: UncertainScene,
    spec: VehicleSpec,
    gains: Gains,
    count: int,
    seed: int,
    motor_lag_s: float,
    controller: str = "with_integral",
) -> TuningFlights:
    """Return sampled flights, and those of the search among them.

    Args:
        uncertain: Scene; parameters with a prior are sampled.
        spec: Vehicle section of the scene.
        gains: Gains of the scene; flights that crash with them are left out.
        count: Number of flights of the search.
        seed: Seed of the samples.
        motor_lag_s: Motor lag [s].
        controller: Name in `vehicle.CONTROLLERS`.

    Raises:
        InputError: All flights crash.
    """
    # five steps in the motor lag, the shortest time constant
    options = Options(step_s=min(TUNING_STEP_S, motor_lag_s / 5))
    drawn, _ = drawn_flights(
        uncertain, spec, SAMPLED_PER_FLIGHT * count, seed, options, controller
    )
    drawn = replace(drawn, seconds=drawn.seconds + FLIGHT_EXTENSION_S)
    none = jnp.zeros(drawn.count)
    _, (peaks, crashed) = FLOWN(jnp.zeros(FACTORS), gains, drawn, none)
    # a crash has no useful gradient; the evaluation still counts it
    kept = np.flatnonzero(~np.asarray(crashed))
    if not kept.size:
        raise InputError(
            f"expected a flight that does not crash with the scene's gains, got "
            f"{crashed.size} that all crash"
        )
    ranks = kept[np.argsort(np.asarray(peaks)[kept])]
    lanes = ranks[chosen_ranks(ranks.size, count)]
    # repeated to the number of samples, for which the objective is compiled
    every = np.resize(kept, drawn.count)
    return TuningFlights(
        _of(drawn, lanes), peaks[lanes], _of(drawn, every), peaks[every]
    )


def chosen_ranks(drawn: int, count: int) -> Int[np.ndarray, " few"]:
    """Return the ranks of the search, of flights in order of their peaks.

    Args:
        drawn: Number of flights; ranks repeat if there are fewer than `count`.
        count: Number of ranks.
    """
    top = count // STRONGEST_SHARE if drawn >= count else 0
    rest = drawn - top
    # the middle of each of equal shares of the ranks
    even = np.floor((np.arange(count - top) + 0.5) * rest / (count - top))
    return np.append(even, np.arange(rest, drawn)).astype(int)


FLOWN = eqx.filter_jit(mean_ln_peak)
"""Compiled objective without its gradient."""


def _of(flights: DrawnFlights, lanes: Int[np.ndarray, " flight"]) -> DrawnFlights:
    each = (flights.load, flights.wind, flights.arrival_s)
    load, wind, arrival = jax.tree.map(lambda x: x[lanes], each)
    return replace(flights, load=load, wind=wind, arrival_s=arrival)


def known_peaks(tried: EvaluatedGains) -> Float[np.ndarray, " flight"]:
    """Return the peak deviations [m], infinite for a diverged vehicle."""
    lost = ~np.isfinite(np.asarray(tried.outcomes.error_m)).all(axis=-1)
    return np.where(lost, np.inf, tried.outcomes.peaks_m)


def scaled(gains: Gains, factors: Float[Array, "8"]) -> Gains:
    """Return gains times factors.

    Args:
        gains: Gains.
        factors: ln of the factors on position, velocity and integral gain (each
            sideways, then upwards), attitude gain and body-rate gain.
    """
    by = jnp.exp(factors)

    def along(n: int) -> Array:
        return jnp.stack([by[n], by[n], by[n + 1]])

    return replace(
        gains,
        position=gains.position * along(0),
        velocity=gains.velocity * along(2),
        integral=gains.integral * along(4),
        attitude=gains.attitude * by[6],
        body_rate=gains.body_rate * by[7],
    )


def drawn_flights(
    uncertain: UncertainScene,
    spec: VehicleSpec,
    vehicles: int,
    seed: int,
    options: Options,
    controller: str = "with_integral",
) -> tuple[DrawnFlights, tuple[str, ...]]:
    """Sample scenes and prepare their flights.

    Args:
        uncertain: Scene; parameters with a prior are sampled.
        spec: Vehicle section of the scene.
        vehicles: Number of scenes, two or more.
        seed: Seed of the samples.
        options: Options of the flights.
        controller: Name in `vehicle.CONTROLLERS`.

    Returns:
        Flights, and remarks on charges above the ground.

    Raises:
        InputError: A parameter cannot be sampled, or no blast arrives in the flight.
    """
    scenes = drawn_scenes(uncertain, vehicles, seed)
    load, source = load_of(scenes, options), uncertain.source or "scene"
    seconds = flight_seconds(scenes, load, spec, source, options)
    start = start_of(spec)
    came = jax.vmap(arrival_at, (0, None, None))(load, spec.held, start.quaternion)
    return (
        DrawnFlights(
            load=load,
            wind=wind_of(scenes),
            arrival_s=came.min(axis=-1),
            start=start,
            # a name is static: it would compile the program again for each vehicle
            vehicle=replace(vehicle_of(spec), name=""),
            target_m=spec.held,
            yaw_rad=spec.yaw,
            seconds=seconds,
            options=options,
            controller=controller,
        ),
        burst_remarks(scenes, spec),
    )


def flown_with(gains: Gains, flights: DrawnFlights) -> Trajectory:
    """Return flights with the given gains, by which they are differentiable."""
    count = flights.count
    start = jax.tree.map(
        lambda x: jnp.broadcast_to(x, (count, *x.shape)), flights.start
    )
    options, controlled = flights.options, gains_controller(flights.controller)
    return simulate(
        flights.vehicle,
        start,
        duration_s=flights.seconds,
        step_s=options.step_s,
        control=controlled(flights.target_m, gains, flights.yaw_rad),
        wind=Gust(flights.wind, 0 * flights.arrival_s),
        loads=(flights.load,),
        ground_up_m=GROUND_UP_M,
        store_every=max(1, round(ROW_S / options.step_s)),
        backend="jax",
    )


def smooth_peaks(
    trajectory: Trajectory, flights: DrawnFlights, power: float
) -> Float[Array, " flight"]:
    """Return ln of the smooth peak deviation [m] after the first blast.

    It is the norm of some power of the path error over time, which approaches the peak
    with increasing power.
    """
    away = trajectory.position_m - flights.target_m[None, None, :]
    # 1e-12 m2: the logarithm and its gradient exist on the target itself
    error = 0.5 * jnp.log(jnp.sum(jnp.square(away), axis=-1) + 1e-12)
    after = trajectory.time_s[None, :] >= flights.arrival_s[:, None]
    # rows before the blast have no weight in the norm
    rows = jnp.where(after, power * error, -jnp.inf)
    return (jax.nn.logsumexp(rows, axis=-1) + jnp.log(ROW_S)) / power


@eqx.filter_jit
def outcomes_of(gains: Gains, flights: DrawnFlights) -> Outcomes:
    """Return the results of flights with the given gains."""
    trajectory = flown_with(gains, flights)
    metrics = flight_metrics(
        trajectory,
        flights.target_m,
        flights.arrival_s,
        tolerance_m=flights.options.tolerance_m,
        ground_up_m=GROUND_UP_M,
    )
    error_m = path_error(trajectory, flights.target_m)
    return Outcomes(metrics, trajectory.time_s, error_m)
