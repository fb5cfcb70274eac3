"""Blasts along a flight, their effect on the vehicle, and the results of flights.

An encounter is the arrival of a blast at the vehicle: its time, its place and the curve
set of the blast, as given or by height of burst. The load follows from jblast's laws,
from a load of the user, or from a custom profile. The exposure of a vehicle is the
peak overpressure, the peak acceleration by the blasts and the time within a fireball;
under a custom profile the first and the last are not known. A batch of flights is
summarised by quantiles over its draws and by the share of vehicles that neither crash
nor are lost. A blast outside the range of its laws is reported: its load is finite, but
not reliable.
"""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from jblast.autopilot.estimator import Thrown
from jblast.errors import argument, require
from jblast.missions import Mission
from jblast.results import Note, warning
from jblast.scene import Charge, Scene, VehicleSpec
from jblast.sensors.camera.fireball import cloud
from jblast.study.missions import MissionOutcome
from jblast.study.statistics import wilson_interval
from jblast.vehicle import (
    CONTROLLERS,
    STEP_S,
    BlastLoad,
    CustomProfile,
    FlightMetrics,
    State,
    Trajectory,
    Vehicle,
    blast_load,
    flight_metrics,
    path_error,
    read_custom_profile,
    vehicle_of,
)
from jblast.vehicle.from_scene import free_air_at
from jblast.vehicle.loads.blast_wave import Blast
from jblast.vehicle.loads.impulse_table import custom_profile
from jblast.vehicle.metrics import THRESHOLDS
from jblast.waves.fireballs import fireball_duration
from jblast.waves.height_of_burst import burst_notes, scaled_height
from jblast.waves.paths import slant_range
from jblast.waves.scaling import scaled_distance

T = TypeVar("T")
METRICS = (
    "error_before_m",
    "error_at_blast_m",
    "error_after_m",
    "peak_deviation_m",
    "peak_time_s",
    "recovery_time_s",
)
"""Metrics of a flight: those of `vehicle.FlightMetrics`, and one of `Flown`."""
QUANTILES = (0.05, 0.5, 0.95)
"""Median and 90 % interval."""
TOLERANCE_M = 0.05
"""Default path error within which a vehicle has recovered [m], by declaration."""
MISSION_STEP_S, MISSION_TOLERANCE_M = 0.004, 0.2
"""Default time step of integrator and controller on a mission [s], PX4's 250 Hz, and
default path error [m]: undisturbed, corners stay below it."""
POSITIVE_OPTIONS = {"seconds": "seconds", "step_s": "step", "tolerance_m": "tolerance"}
"""Options that are positive numbers, and their names in messages."""
GROUND_UP_M = 0.0
"""Height of the ground, from which scenes measure heights."""
ROWS = 20_000
"""Rows of a single flight: 10 s at the default step."""
WINDOW_S = 5e-5
"""Averaging time of an acceleration [s]: a tenth of the time that a front takes to
cross a vehicle, so that the peak is resolved."""
WINDOWS = np.arange(-20.0, 80.0)
"""Windows around an arrival, -1 to 4 ms: they cover the passage of a front."""
FlightLoad = BlastLoad | CustomProfile | Any
"""Load of the blasts of a scene; a user's own is a `Pulse` with `arrival_time_s`."""


class Exposure(NamedTuple):
    """Exposure of a vehicle to the blasts of a flight.

    Attributes:
        peak_overpressure_pa: Largest incident overpressure; NaN with a custom profile.
        peak_acceleration_m_s2: Largest acceleration by the blasts alone.
        fireball_time_s: Time within glowing fireballs, resolved by the stored rows; NaN
            with a custom profile.
    """

    peak_overpressure_pa: Float[Array, "*batch"]
    peak_acceleration_m_s2: Float[Array, "*batch"]
    fireball_time_s: Float[Array, "*batch"]


EXPOSURES = Exposure._fields


class Encounter(NamedTuple):
    """Arrivals of blasts at a vehicle, with the blasts along the last axis.

    Attributes:
        arrival_s: Arrival on the scene's clock; infinite for a blast without a time.
        distance_m: Distance of the vehicle from the charge at the arrival.
        scaled_distance: Sachs-scaled distance [m/kg^(1/3)]; NaN with a custom profile.
        overpressure_pa: Incident peak overpressure; NaN except with jblast's laws.
        in_range: Whether the distance is inside the range of validity of the load.
    """

    arrival_s: Float[Array, "*batch blast"]
    distance_m: Float[Array, "*batch blast"]
    scaled_distance: Float[Array, "*batch blast"]
    overpressure_pa: Float[Array, "*batch blast"]
    in_range: Bool[Array, "*batch blast"]


class Flown(NamedTuple):
    """Flights with one controller; leading axes are those of the batch.

    Attributes:
        metrics: Metrics from the first arrival on.
        encounter: Arrival of each blast.
        exposure: Exposure to the blasts.
        error_at_blast_m: Path error at the first arrival.
        lost: Whether the vehicle diverged.
        trajectory: A single flight; None for a batch.
        thrown: Effect of the blasts on the state estimate; None without an estimator.
    """

    metrics: FlightMetrics
    encounter: Encounter
    exposure: Exposure
    error_at_blast_m: Float[Array, "*batch"]
    lost: Bool[Array, "*batch"]
    trajectory: Trajectory | None = None
    thrown: Thrown | None = None


def metric(flown: Flown, name: str) -> Float[np.ndarray, "*batch"]:
    """Return one of `METRICS` or of `EXPOSURES`."""
    owner = flown if name == "error_at_blast_m" else flown.metrics
    return np.asarray(getattr(flown.exposure if name in EXPOSURES else owner, name))


def quantiles(
    values: Float[np.ndarray, " vehicle"], shares: tuple[float, ...] = QUANTILES
) -> list[float]:
    """Return quantiles without interpolation, as values may be infinite.

    NaN, as of a vehicle that diverged before its blast, is ignored.
    """
    known = values[~np.isnan(values)]
    if not known.size:
        return [float("nan")] * len(shares)
    return [float(np.quantile(known, s, method="inverted_cdf")) for s in shares]


def flies_on(flown: Flown) -> Bool[np.ndarray, "*batch"]:
    """Return the vehicles that neither crashed nor diverged, recovered or not."""
    return np.asarray(~flown.metrics.crashed)


def past_threshold(
    model: str, flown: Flown
) -> dict[str, Bool[np.ndarray, "*batch"] | None]:
    """Return the vehicles beyond a threshold of the model, by exposure.

    None stands for an exposure without a threshold or without values.
    """
    found: dict[str, Bool[np.ndarray, "*batch"] | None] = {}
    for name in EXPOSURES:
        limit, values = THRESHOLDS[model][name].value, metric(flown, name)
        unknown = limit is None or np.isnan(values).all()
        found[name] = None if unknown else np.asarray(values > limit)
    return found


def share_interval(flags: Bool[np.ndarray, " vehicle"]) -> tuple[float, float]:
    """Return the 90 % interval of the share of flags that are true."""
    low, high = wilson_interval(np.mean(flags), flags.size)
    return float(low), float(high)


@dataclass(frozen=True)
class Options:
    """Options of flights; those of `fly` that are None have other defaults.

    Attributes:
        seconds: Duration; None: until 5 s beyond the last arrival, of a mission until
            the vehicle is disarmed.
        least_s: Shortest duration of a flight without a given one.
        step_s: Time step of the integrator; with an estimator or on a mission 4 ms.
        backend: "auto", "jax", "warp", "warp:cpu" or "warp:cuda:0".
        tolerance_m: Path error within which a vehicle has recovered; on a mission
            0.2 m.
        profile: Impulses of the blasts in place of the laws: a file, or the cases of
            `vehicle.read_custom_profile`.
        profile_moments_about: Vector from the reference point of the profile's moments
            to the centre of mass, body axes [m]; None: they refer to it.
        load: Function from a scene to the load of its blasts on the vehicle.
        estimator: "ekf" for a Kalman filter of the instruments; "" for the true state.
    """

    seconds: float | None = None
    least_s: float = 0.0
    step_s: float = STEP_S
    backend: str = "auto"
    tolerance_m: float = TOLERANCE_M
    profile: Float[np.ndarray, "case 10"] | None = None
    profile_moments_about: Sequence[float] | None = None
    load: Callable[[Scene], FlightLoad] = blast_load
    estimator: str = ""

    @property
    def load_words(self) -> str:
        """Source of the load: "laws", "custom profile" or the user's function."""
        if self.profile is not None:
            return "custom profile"
        return "laws" if self.load is blast_load else self.load.__name__


def options_of(*, on_mission: bool, **given: Any) -> Options:
    """Return options with the defaults of a flight; None stands for a default.

    Args:
        on_mission: Whether the vehicle flies a mission.
        given: Attributes of `Options`.

    Raises:
        InputError: A number is not positive, or the profile cannot be read.
    """
    known = {name: value for name, value in given.items() if value is not None}
    for name, word in POSITIVE_OPTIONS.items():
        value = known.get(name, 1.0)
        positive = math.isfinite(value) and value > 0
        require(positive, argument(word), "a positive number", f"{value:g}")
    alone = "profile" not in known and "profile_moments_about" in known
    words = f"it with {argument('profile')} only"
    require(not alone, argument("profile_moments_about"), words, "no profile")
    if isinstance(known.get("profile"), str | os.PathLike):
        known["profile"] = read_custom_profile(known["profile"])
    defaults: dict[str, Any] = {}
    if on_mission:
        defaults["tolerance_m"] = MISSION_TOLERANCE_M
    # an estimator samples its instruments at each step: PX4 has 250 Hz
    if on_mission or known.get("estimator"):
        defaults["step_s"] = MISSION_STEP_S
    return Options(**defaults | known)


@dataclass(frozen=True)
class Flights:
    """Flights through the blasts of a scene, hovering or on a mission.

    Attributes:
        vehicle: Vehicle section of the scene.
        mission: Mission as planned; None for a hovering vehicle.
        options: Options of the flights.
        seconds: Duration of each flight; of a mission until a second after disarming.
        count: Number of sampled scenes, each flown with each controller.
        drawn: Sampled parameters, by name of `scene.PARAMETERS`.
        blasts: Names of the charges; "" for a single one.
        places_m: Positions of the charges, east, north, up.
        wind_m_s: Wind velocity towards east, north.
        holds: Flights by controller, a name in `vehicle.CONTROLLERS` or "mission".
        own: Controller that the scene specifies; None without one.
        outcome: Outcome of the mission; None without one.
        notes: Remarks on the curve sets of the blasts.
    """

    vehicle: VehicleSpec
    mission: Mission | None
    options: Options
    seconds: float
    count: int
    drawn: dict[str, Float[np.ndarray, "*batch"]]
    blasts: tuple[str, ...]
    places_m: Float[np.ndarray, "*batch blast 3"]
    wind_m_s: Float[np.ndarray, "*batch 2"]
    holds: dict[str, Flown]
    own: str | None
    outcome: MissionOutcome | None
    notes: tuple[str, ...] = ()

    @property
    def first(self) -> Flown:
        """Flights with the first controller."""
        return next(iter(self.holds.values()))

    @property
    def trajectory(self) -> Trajectory:
        """Trajectory of a single flight with the first controller."""
        assert self.first.trajectory is not None, "a batch keeps no trajectories"
        return self.first.trajectory


def flight_notes(flights: Flights) -> list[Note]:
    """Return notes on the validity of the results, with the share of such flights."""
    met, outcome = flights.first.encounter, flights.outcome
    source = "laws" if flights.options.profile is None else "profile"
    arrival, out_of_range = np.asarray(met.arrival_s), np.asarray(~met.in_range)
    notes = [warning("remark", text=text) for text in flights.notes]
    found: list[tuple[str, Any, dict[str, str]]] = []
    if outcome is not None and flights.mission is not None:
        ignored, crash = flights.mission.plan.ignored, outcome.crash
        missed = np.array([one.waypoint is None for one in outcome.disturbances], bool)
        notes += [warning("remark", text=ignored)] if ignored else []
        notes += [warning("vehicle_crashed", cause=crash)] if crash else []
        if not crash and math.isnan(outcome.disarmed_s):
            notes.append(warning("mission_unfinished"))
        found.append(("blast_not_in_flight", missed.any(), {}))
        out_of_range = out_of_range & ~missed
    found.append(("blast_out_of_range", out_of_range.any(axis=-1), {"source": source}))
    if outcome is None:
        late = (arrival > flights.seconds) & (arrival < np.inf)
        found += [
            ("blast_never", np.isposinf(arrival).any(axis=-1), {}),
            ("blast_late", late.any(axis=-1), {}),
        ]
        for name, flown in flights.holds.items():
            away = flown.error_at_blast_m > flights.options.tolerance_m
            by = {"controller": hold_words(name)}
            found += [("not_settled", away, by), ("lost", flown.lost, by)]
    notes += [
        warning(kind, share=float(np.mean(flags)), **names)
        for kind, flags, names in found
        if np.any(flags)
    ]
    return notes


def hold_words(name: str) -> str:
    """Return the printed name of a controller; "" for that of a mission."""
    return CONTROLLERS[name].words if name in CONTROLLERS else ""


def mapped(function: Callable[..., T], scenes: Scene, *others: Any) -> T:
    """Return the value of a function of a scene and others, or of each of a batch."""
    batch = scenes.air.wind_east.ndim > 0
    return (eqx.filter_vmap(function) if batch else function)(scenes, *others)


def burst_remarks(scenes: Scene, vehicle: VehicleSpec) -> tuple[str, ...]:
    """Return remarks on charges above the ground: their curves at a vehicle's start.

    These are the free-air curves if the ground reflection arrives there after the
    positive phase, else the surface curves, which are stronger (`vehicle.blast_load`).

    Args:
        scenes: One scene, or several with a leading axis in each array.
        vehicle: Vehicle section with the start position.
    """
    place, notes = jnp.asarray(vehicle.position)[None, :], []
    for n, charge in enumerate(scenes.charges):
        if not np.any(np.asarray(charge.up) > 0.0):
            continue

        def weight_and_height(scene: Scene, n: int = n) -> tuple[Array, Array]:
            own: Charge = scene.charges[n]
            return free_air_at(scene, own, place)[0], scaled_height(scene, own)

        weight, height = map(np.ravel, mapped(weight_and_height, scenes))
        span = float(height.min()), float(height.max())
        (note,) = burst_notes(charge, span, weight, "vehicle")
        high = weight >= 1.0
        alike = {0: "surface", high.size: "free-air"}
        burst = charge.burst or alike.get(int(high.sum()))
        which = f"all waves are those of a {burst} burst"
        if not burst:
            which = (
                f"waves are those of a free-air burst at {high.sum()} of {high.size} "
                "vehicles, else of a surface burst"
            )
        notes.append(f"{note}; {which}")
    return tuple(notes)


def effects(
    load: FlightLoad,
    scene: Scene,
    vehicle: Vehicle,
    flight: Trajectory,
    target_m: Float[Array, "..."],
    tolerance_m: float,
) -> Flown:
    """Return the effects of the blasts on one flight.

    Args:
        load: Loads of the blasts.
        scene: Scene with the charges of the fireballs.
        vehicle: Vehicle.
        flight: The flight.
        target_m: Target, or set point of each row.
        tolerance_m: Path error within which the vehicle has recovered.
    """
    # blasts are evaluated at `ROWS` rows at most
    some = flight.at(slice(None, None, -(-flight.time_s.size // ROWS)))
    encounter = encounter_of(load, some.time_s, some.position_m, some.quaternion)
    first, error = encounter.arrival_s.min(), path_error(flight, target_m)
    metrics = flight_metrics(
        flight,
        target_m,
        first,
        tolerance_m=tolerance_m,
        ground_up_m=GROUND_UP_M,
    )
    # the error of the last row before the blast: the effect of start and wind alone
    last = jnp.maximum(jnp.sum(flight.time_s < first) - 1, 0)
    exposure = exposed(scene, load, vehicle, encounter, some.time_s, some.states)
    return Flown(metrics, encounter, exposure, error[last], flight.lost)


def exposed(
    scene: Scene,
    load: FlightLoad,
    vehicle: Vehicle,
    encounter: Encounter,
    time_s: Float[Array, " time"],
    states: State,
) -> Exposure:
    """Return the exposure of one flight.

    A blast that arrives after the flight has no effect.

    Args:
        scene: Scene with the charges of the fireballs.
        load: Loads of the blasts.
        vehicle: Vehicle.
        encounter: Arrivals of `encounter_of`.
        time_s: Times of the stored rows.
        states: States at these times.
    """
    in_flight = encounter.arrival_s <= time_s[-1]
    # a finite time for blasts without an arrival; their results are masked below
    arrival = jnp.where(in_flight, encounter.arrival_s, 0.0)

    def accelerations(came: Float[Array, ""]) -> Float[Array, " window"]:
        # the state before the blast: its own effect on the attitude must not enter
        last = jnp.maximum(jnp.sum(time_s < came) - 1, 0)
        state = jax.tree.map(lambda x: x[last], states)

        def one(start: Float[Array, ""]) -> Float[Array, ""]:
            push, _ = load.impulse(start, start + WINDOW_S, state, vehicle)
            return jnp.linalg.norm(push) / (WINDOW_S * vehicle.mass_kg)

        return jax.vmap(one)(came + WINDOW_S * WINDOWS)

    greatest = jnp.max(jax.vmap(accelerations)(arrival), axis=-1)
    return Exposure(
        jnp.max(jnp.where(in_flight, encounter.overpressure_pa, 0.0)),
        jnp.max(jnp.where(in_flight, greatest, 0.0)),
        _in_fire(scene, load, time_s, states.position_m),
    )


def _in_fire(
    scene: Scene,
    load: FlightLoad,
    time_s: Float[Array, " time"],
    position_m: Float[Array, "time 3"],
) -> Float[Array, ""]:
    """Return the time that a vehicle is within the fireball of any charge [s]."""
    if isinstance(load, CustomProfile):
        return jnp.full((), jnp.nan)

    def burns_about(charge: Charge) -> Bool[Array, " time"]:
        ball = jax.vmap(
            lambda time: cloud(charge, time, scene.air, scene.fireball_growth)
        )(time_s)
        away = jnp.sum(jnp.square(position_m - ball.centre), axis=-1)
        since = charge.since(time_s)
        # the cloud remains after the fire: only the glowing part counts
        life = fireball_duration(charge.tnt_mass("fireball_radius_m"))
        return (since > 0) & (since < life) & (away < jnp.square(ball.radius))

    # as charges of TNT, which are one batch
    alike = [
        Charge(charge.tnt_mass("fireball_radius_m"), charge.position_m, charge.time_s)
        for charge in scene.charges
    ]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *alike)
    inside = jax.vmap(burns_about)(stacked).any(axis=0)
    return jnp.sum(jnp.where(inside[:-1], jnp.diff(time_s), 0.0))


def load_of(scenes: Scene, options: Options) -> FlightLoad:
    """Return the load of the blasts by laws, or by a profile of the one charge.

    Args:
        scenes: One scene, or several with a leading axis in each array.
        options: Options with the laws or the profile.

    Raises:
        InputError: As in `vehicle.blast_load` and
            `vehicle.loads.impulse_table.custom_profile`.
    """
    if options.profile is None:
        return _happening(mapped(options.load, scenes))
    profile = custom_profile(
        options.profile,
        moment_point_m=options.profile_moments_about,
        vehicle=None if scenes.vehicle is None else vehicle_of(scenes.vehicle),
    )

    def at_charge(scene: Scene) -> CustomProfile:
        place, time_s = jnp.stack(scene.charge.position_m), scene.charge.time_s
        return replace(profile, charge_m=place, time_s=time_s + 0 * profile.time_s)

    return mapped(at_charge, scenes)


def _happening(load: FlightLoad) -> FlightLoad:
    """Return a load without reflections that reach no vehicle of a batch.

    Each would be one more wave in every step.
    """
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves(load))
    if traced or not isinstance(load, BlastLoad) or load.waves.time_s.ndim < 2:
        return load
    some = np.array(np.isfinite(load.waves.time_s).any(axis=0))
    some[: load.charges] = True
    return replace(load, waves=jax.tree.map(lambda x: x[:, some], load.waves))


def arrival_at(
    load: FlightLoad, position_m: Float[Array, "3"], quaternion: Float[Array, "4"]
) -> Float[Array, " blast"]:
    """Return the arrivals of blasts at a position [s]; infinite for no blast."""
    if isinstance(load, CustomProfile):
        return (load.time_s + load.impulse_at(position_m, quaternion)[2])[None]
    return load.arrival_time_s(position_m)


def encounter_at(
    load: FlightLoad, position_m: Float[Array, "3"], quaternion: Float[Array, "4"]
) -> Encounter:
    """Return the arrivals of blasts at a position."""
    arrival = arrival_at(load, position_m, quaternion)
    unknown = jnp.full_like(arrival, jnp.nan)
    if isinstance(load, CustomProfile):
        distance = slant_range(load.charge_m, position_m)[None]
        valid = load.in_range(position_m, quaternion) | jnp.isposinf(load.time_s)
        return Encounter(arrival, distance, unknown, unknown, valid[None])
    if not isinstance(load, BlastLoad):  # of a user: only its arrivals are known
        valid = jnp.ones_like(arrival, bool)
        return Encounter(arrival, unknown, unknown, unknown, valid)

    def met(blast: Blast) -> tuple[Array, ...]:
        distance = slant_range(blast.position_m, position_m)
        # no division by zero for a vehicle at the position of the charge
        positive = jnp.maximum(distance, 1e-9)
        scaled = scaled_distance(positive, blast.mass_kg, load.pressure_pa)
        peak = blast.wave(load.air, position_m).peak
        return distance, scaled, jnp.where(jnp.isposinf(blast.time_s), 0.0, peak)

    distances, scaled, peaks = jax.vmap(met)(load.blasts)
    pressure_pa, valid = peaks * load.pressure_pa, load.in_range(position_m)
    return Encounter(arrival, distances, scaled, pressure_pa, valid)


def encounter_of(
    load: FlightLoad,
    time_s: Float[Array, " time"],
    position_m: Float[Array, "time 3"],
    quaternion: Float[Array, "time 4"],
) -> Encounter:
    """Return the arrivals of blasts along a flight, at the last row before each.

    A blast after the end of the flight is evaluated at its last row.
    """
    rows = jax.vmap(encounter_at, (None, 0, 0))(load, position_m, quaternion)
    # the first row that a blast has reached ends the product: later rows cannot return
    ahead = jnp.cumprod(time_s[:, None] < rows.arrival_s, axis=0)
    last = jnp.maximum(jnp.sum(ahead, axis=0) - 1, 0)
    blasts = jnp.arange(last.size)
    return Encounter(*(values[last, blasts] for values in rows))
