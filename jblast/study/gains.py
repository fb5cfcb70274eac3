"""Gains of a position controller tuned by gradient, within stability margins.

The unknowns are the logarithms of eight factors on the scene's gains, nine if the
motors may be lead-compensated (`motor_lead`): of position, velocity and integral
gain sideways and upwards, and of the attitude and body-rate gains. The objective is
half the mean, over drawn blasts, of ln of the peak deviation, plus half ln of the
8-norm of these peaks, which weighs the strongest. Each peak is smooth (`smooth_peaks`)
and differentiated in reverse mode through every step of its flight. Three terms are
added: half the mean of ln of the 2-norm of the path error over time, because a vehicle
that is displaced little may return slowly; a large penalty on any peak above that of
the scene's gains; and a thousandth of the squared factors, so that gains without
influence stay. The margins of all loops are constraints with their own derivatives.
Sequential quadratic programming (Kraft 1988, SciPy's SLSQP) searches from the scene's
gains, whose margins may be too small, to the nearest local optimum.

The flights of the search use the semi-implicit Euler rule, whose program is a third of
that of RK4, and a few of many drawn flights. Of the best gains found, the result is the
set with the best value over the many flights, among those whose largest peak does not
exceed the largest with the scene's gains, if there are any. Unseen flights are computed
as by `jblast fly`. Blasts that crash the vehicle with the scene's own gains are left
out of the tuning, but not out of the evaluation.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy.optimize import OptimizeResult, minimize

from jblast.errors import InputError
from jblast.progress import in_words
from jblast.scene import UncertainScene, VehicleSpec
from jblast.study.flight_results import (
    FlightLoad,
    Options,
    arrival_at,
    load_of,
    with_bursts_at_start,
)
from jblast.study.flights import (
    GROUND_UP_M,
    checked_scene,
    drawn_scenes,
    flight_seconds,
    steady_wind,
)
from jblast.vehicle import (
    STEP_S,
    Each,
    FlightMetrics,
    State,
    StepGust,
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
from jblast.vehicle.control.stability import Margins, hold_margins, is_stable
from jblast.vehicle.controllers import gains_controller

MOST_STEPS, LARGEST = 60, np.log(30.0)
"""Of the search, and of a factor in ln."""
CANDIDATES = 12
"""Of the search's best, among which the many flights choose."""
UNSEEN_SEEDS = 1_000_003
"""Between the seed of the blasts tuned by and that of the unseen ones."""
SLACK = 0.002
"""By what the search keeps off the margins, as a share of them."""
DRAWN, STRONGEST = 8, 4
"""Flights drawn for each that is tuned by, of which one in so many is of the highest
peaks; the rest stand for all of them, at even ranks."""
TUNING_STEP_S, AFTER_S = 1e-3, -2.0
"""Longest step; how much shorter a flight is than `jblast fly` makes it."""
FACTORS = 9
"""Factors of a search: eight of gains, and the lead of the motors."""
POWER, TAIL = 24.0, 8.0
"""Of the norms over a flight's rows, and over the flights."""
RIDGE, WAY_BACK = 1e-3, 0.5
"""Of the squares of the factors, and of the path error over time."""
WORSE = 64.0
"""Of the mean square of what ln of a peak is more than with the scene's gains."""
ENOUGH = 3.0
"""Margins beyond so many times what is asked do not guide the search."""
ROW_S = 0.01
"""Between two rows: a peak is of a tenth of a second and more."""


class Outcomes(eqx.Module):
    """What became of flights with some gains.

    Attributes:
        metrics: From the first blast on.
        time_s: Of the rows.
        error_m: Path error at each row.
    """

    metrics: FlightMetrics
    time_s: Float[np.ndarray, " time"]
    error_m: Float[np.ndarray, "flight time"]

    @property
    def peaks_m(self) -> Float[np.ndarray, " flight"]:
        """Peak deviations."""
        return np.asarray(self.metrics.peak_deviation_m)

    @property
    def flies_on(self) -> Bool[np.ndarray, " flight"]:
        """Who neither crashed nor was lost."""
        return ~np.asarray(self.metrics.crashed)


@dataclass(frozen=True)
class Tried:
    """A hold with some gains.

    Attributes:
        gains: The gains.
        margins: Of each loop of `vehicle.control.stability.LOOPS`.
        outcomes: Of the unseen blasts.
    """

    gains: Gains
    margins: Margins
    outcomes: Outcomes

    @property
    def gain_margin_db(self) -> float:
        """Least gain margin of all loops, upwards or downwards [dB]."""
        return float(np.min(np.asarray(self.margins.gain_db)))

    @property
    def phase_margin_deg(self) -> float:
        """Least phase margin of all loops [degrees]."""
        return float(np.min(np.asarray(self.margins.phase_deg)))


@dataclass(frozen=True)
class Wish:
    """How gains are tuned.

    Attributes:
        margin_db: Least of the gain margins, upwards and downwards [dB].
        margin_deg: Least of the phase margins [degrees].
        delay_s: Of the real loop, that the flights do not have: sensors, computing [s].
        vehicles: Blasts that gains are tuned by.
        unseen: Blasts that they are judged by.
        seed: Of the blasts.
        motor_lead: Most by which the motors' lag may be shortened; 1: the scene's lead
            stays.
        controller: A name of `vehicle.CONTROLLERS` whose loops are those of the SE(3)
            hold; None: the scene's own hold.
    """

    margin_db: float = 6.0
    margin_deg: float = 35.0
    delay_s: float = 0.0
    vehicles: int = 32
    unseen: int = 200
    seed: int = 0
    motor_lead: float = 1.0
    controller: str | None = None


@dataclass(frozen=True)
class TunedGains:
    """Gains before and after.

    Attributes:
        vehicle: Its section of the scene.
        wish: How they were tuned.
        before: The scene's.
        after: The tuned ones.
        ln_peaks: The objective (see the module's text) at each step of the search.
        converged: Whether the search ended of itself.
        notes: Remarks on the curve sets of the blasts.
    """

    vehicle: VehicleSpec
    wish: Wish
    before: Tried
    after: Tried
    ln_peaks: tuple[float, ...]
    converged: bool
    notes: tuple[str, ...] = ()

    def cut(self, share: float = 0.5) -> float:
        """Return by how much a quantile of the peak deviation is less; 0.2: a fifth."""
        before, after = (
            float(np.quantile(known_peaks(one), share))
            for one in (self.before, self.after)
        )
        return 1.0 - after / before


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
    own = "without_integral" if spec.integral is False else "with_integral"
    controller = own if wish.controller is None else wish.controller
    gains_controller(controller)  # refuses one with other loops
    gains = controller_of(spec, controller).gains
    vehicle = vehicle_of(spec)
    lag, dead = float(vehicle.motor_lag_s), STEP_S / 2 + wish.delay_s
    now = in_words()
    now("drawing blasts, flown with the scene's gains")
    flights = tuning_flights(
        uncertain, spec, gains, wish.vehicles, wish.seed, lag, controller
    )
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
            # a crash has no slope: a large value, from which the line search steps back
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
    # a candidate by itself: the search may find nothing better
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
    unseen, notes = drawn_flights(
        uncertain, spec, wish.unseen, seed, Options(), controller
    )
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


class DrawnFlights(eqx.Module):
    """Flights of one vehicle, each through blasts of its own.

    Attributes:
        load: Of the blasts; a leading axis of flights.
        wind: Velocity of the air, east, north, up [m/s].
        arrival_s: When the first blast comes to the place held.
        start: Of the vehicle.
        vehicle: Which.
        target_m: The place held.
        yaw_rad: The heading held.
        seconds: How long each flight is.
        options: How they are flown.
        controller: A name of `vehicle.CONTROLLERS`.
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
        """How many flights."""
        return self.arrival_s.shape[0]


class TuningFlights(NamedTuple):
    """Flights to tune by, and those to choose by.

    Attributes:
        few: Flown with slopes at each step of the search.
        ln_few: Of each ln of its peak deviation with the scene's gains.
        many: Flown once with each gains among which is chosen.
        ln_many: Likewise.
    """

    few: DrawnFlights
    ln_few: Float[Array, " few"]
    many: DrawnFlights
    ln_many: Float[Array, " many"]


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


def mean_ln_peak(
    factors: Float[Array, "9"],
    gains: Gains,
    flights: DrawnFlights,
    ln_before: Float[Array, " flight"],
) -> tuple[Float[Array, ""], tuple[Float[Array, " flight"], Bool[Array, " flight"]]]:
    """Return what is made least; of each flight ln of its peak, and whether it crashes.

    Args:
        factors: As in `scaled`.
        gains: The scene's.
        flights: Those to tune by.
        ln_before: Of each ln of its peak with the scene's gains.
    """
    trajectory = flown_with(scaled(gains, factors), flights)
    peaks = smooth_peaks(trajectory, flights, POWER)
    metrics = flight_metrics(
        jax.lax.stop_gradient(trajectory),
        flights.target_m,
        flights.arrival_s,
        ground_up_m=GROUND_UP_M,
    )
    strongest = jax.nn.logsumexp(TAIL * peaks) - jnp.log(peaks.size)
    middle = (jnp.mean(peaks) + strongest / TAIL) / 2
    back = WAY_BACK * jnp.mean(smooth_peaks(trajectory, flights, 2.0))
    more = jnp.maximum(peaks - ln_before, 0)
    worse = WORSE * jnp.mean(more * more)
    least = middle + back + worse + RIDGE * jnp.sum(factors**2)
    return least, (peaks, metrics.crashed)


_PEAK = eqx.filter_jit(jax.value_and_grad(mean_ln_peak, has_aux=True))


def margins_to_spare(
    factors: Float[Array, "9"],
    gains: Gains,
    motor_lag_s: float,
    dead_time_s: float,
    asked: Float[Array, "2"],
) -> Float[Array, " loop_margin"]:
    """Return by what share margins are more than is asked: gain [dB], phase [deg]."""
    margins = hold_margins(scaled(gains, factors), motor_lag_s, dead_time_s)
    shares = [
        margins.up_db / asked[0],
        margins.down_db / asked[0],
        margins.phase_deg / asked[1],
    ]
    return jnp.minimum(jnp.concatenate(shares), ENOUGH) - 1.0


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


def tuning_flights(
    uncertain: UncertainScene,
    spec: VehicleSpec,
    gains: Gains,
    count: int,
    seed: int,
    motor_lag_s: float,
    controller: str = "with_integral",
) -> TuningFlights:
    """Draw flights and choose those to tune by.

    Args:
        uncertain: The scene; what has a prior is drawn from it.
        spec: Its vehicle.
        gains: The scene's; flights that crash with them are left out.
        count: How many to tune by.
        seed: Of the draws.
        motor_lag_s: Of the motors [s].
        controller: A name of `vehicle.CONTROLLERS`.

    Raises:
        InputError: All crash.
    """
    step = min(TUNING_STEP_S, motor_lag_s / 5)
    options = Options(step_s=step, integrator="euler")
    drawn, _ = drawn_flights(uncertain, spec, DRAWN * count, seed, options, controller)
    drawn = replace(drawn, seconds=drawn.seconds + AFTER_S)
    none = jnp.zeros(drawn.count)
    _, (peaks, crashed) = FLOWN(jnp.zeros(FACTORS), gains, drawn, none)
    kept = np.flatnonzero(~np.asarray(crashed))
    if not kept.size:
        raise InputError(
            f"expected flights that stay up to tune gains by, got {crashed.size} that "
            "all crash with the scene's own gains"
        )
    ranks = kept[np.argsort(np.asarray(peaks)[kept])]
    lanes = ranks[chosen_ranks(ranks.size, count)]
    every = np.resize(kept, drawn.count)
    return TuningFlights(
        _of(drawn, lanes), peaks[lanes], _of(drawn, every), peaks[every]
    )


def chosen_ranks(drawn: int, count: int) -> Int[np.ndarray, " few"]:
    """Return which ranks are tuned by, of flights in the order of their peaks.

    Args:
        drawn: How many there are; the same stand more than once where they are few.
        count: How many to return.
    """
    top = count // STRONGEST if drawn >= count else 0
    rest = drawn - top
    even = np.floor((np.arange(count - top) + 0.5) * rest / (count - top))
    return np.append(even, np.arange(rest, drawn)).astype(int)


FLOWN = eqx.filter_jit(mean_ln_peak)
"""What is made least, without its slopes."""


def _of(flights: DrawnFlights, lanes: Int[np.ndarray, " flight"]) -> DrawnFlights:
    each = (flights.load, flights.wind, flights.arrival_s)
    load, wind, arrival = jax.tree.map(lambda x: x[lanes], each)
    return replace(flights, load=load, wind=wind, arrival_s=arrival)


def known_peaks(tried: Tried) -> Float[np.ndarray, " flight"]:
    """Return the peak deviations [m]; who ran away has an infinite one."""
    lost = ~np.isfinite(tried.outcomes.error_m).all(axis=-1)
    return np.where(lost, np.inf, tried.outcomes.peaks_m)


def scaled(gains: Gains, factors: Float[Array, "9"]) -> Gains:
    """Return gains times factors.

    Args:
        gains: The gains.
        factors: In ln: of position, velocity and integral gain, sideways and then
            upwards, of attitude, of body rate, and of the motors' lead if there is one.
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
        motor_lead=None if gains.motor_lead is None else gains.motor_lead * by[8],
    )


def drawn_flights(
    uncertain: UncertainScene,
    spec: VehicleSpec,
    vehicles: int,
    seed: int,
    options: Options,
    controller: str = "with_integral",
) -> tuple[DrawnFlights, tuple[str, ...]]:
    """Draw scenes and make their flights ready.

    Args:
        uncertain: The scene; what has a prior is drawn from it.
        spec: Its vehicle.
        vehicles: How many are drawn, two and more.
        seed: Of the draws.
        options: How they are flown.
        controller: A name of `vehicle.CONTROLLERS`.

    Returns:
        The flights, and remarks on charges above the ground.

    Raises:
        InputError: A number cannot be drawn, or no blast comes during the flight.
    """
    scenes = drawn_scenes(uncertain, vehicles, seed)
    scenes, notes = with_bursts_at_start(scenes, spec)
    seconds = flight_seconds(scenes, spec, uncertain.source, options)
    load = eqx.filter_vmap(lambda scene: load_of(scene, None))(scenes)
    start = start_of(spec)
    came = jax.vmap(arrival_at, (0, None, None))(load, spec.held, start.quaternion)
    return (
        DrawnFlights(
            load=load,
            wind=steady_wind(scenes),
            arrival_s=came.min(axis=-1),
            start=start,
            # a name would compile the program once more for each vehicle
            vehicle=replace(vehicle_of(spec), name=""),
            target_m=spec.held,
            yaw_rad=spec.yaw,
            seconds=seconds,
            options=options,
            controller=controller,
        ),
        notes,
    )


def flown_with(gains: Gains, flights: DrawnFlights) -> Trajectory:
    """Fly with some gains; pure, and differentiable by them."""
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
        integrator=options.integrator,
        control=controlled(flights.target_m, gains, flights.yaw_rad),
        wind=Each(StepGust(flights.wind, 0 * flights.arrival_s)),
        loads=(Each(flights.load),),
        ground_up_m=GROUND_UP_M,
        store_every=max(1, round(ROW_S / options.step_s)),
        backend="jax",
    )


def smooth_peaks(
    trajectory: Trajectory, flights: DrawnFlights, power: float
) -> Float[Array, " flight"]:
    """Return ln of the peak deviation [m] after the first blast, smooth in the rows.

    The mean of some power of the path error, over a second: the higher the power, the
    nearer the peak.
    """
    away = trajectory.position_m - flights.target_m[None, None, :]
    error = 0.5 * jnp.log(jnp.sum(jnp.square(away), axis=-1) + 1e-12)
    after = trajectory.time_s[None, :] >= flights.arrival_s[:, None]
    rows = jnp.where(after, power * error, -jnp.inf)
    return (jax.nn.logsumexp(rows, axis=-1) + jnp.log(ROW_S)) / power


def outcomes_of(gains: Gains, flights: DrawnFlights) -> Outcomes:
    """Fly with some gains and return what became of it."""
    metrics, time, error = _outcomes(gains, flights)
    return Outcomes(metrics, np.asarray(time), np.asarray(error))


@eqx.filter_jit
def _outcomes(gains: Gains, flights: DrawnFlights):
    trajectory = flown_with(gains, flights)
    metrics = flight_metrics(
        trajectory,
        flights.target_m,
        flights.arrival_s,
        tolerance_m=flights.options.tolerance_m,
        ground_up_m=GROUND_UP_M,
    )
    return metrics, trajectory.time_s, path_error(trajectory, flights.target_m)
