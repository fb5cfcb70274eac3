"""A scene's vehicle flown through its blasts by gains that may be traced."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene import Scene, UncertainScene, VehicleSpec
from jblast.study.flights.bursts import with_bursts_at_start
from jblast.study.flights.draws import drawn_scenes
from jblast.study.flights.duration import flight_seconds
from jblast.study.flights.encounter import FlightLoad, arrival_at, load_of
from jblast.study.flights.fly import GROUND_UP_M, steady_wind
from jblast.study.flights.records import Options
from jblast.vehicle import (
    Each,
    FlightMetrics,
    Gains,
    PositionHold,
    State,
    StepGust,
    Trajectory,
    Vehicle,
    flight_metrics,
    path_error,
    simulate,
    start_of,
    vehicle_of,
)

ROW_S = 0.01
"""Between two rows: a peak is of a tenth of a second and more."""


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

    @property
    def count(self) -> int:
        """How many flights."""
        return self.arrival_s.shape[0]


def drawn_flights(
    uncertain: UncertainScene,
    spec: VehicleSpec,
    vehicles: int,
    seed: int,
    options: Options,
) -> tuple[DrawnFlights, tuple[str, ...]]:
    """Draw scenes and make their flights ready.

    Args:
        uncertain: The scene; what has a prior is drawn from it.
        spec: Its vehicle.
        vehicles: How many are drawn, two and more.
        seed: Of the draws.
        options: How they are flown.

    Returns:
        The flights, and what there is to say of charges above the ground.

    Raises:
        InputError: A number cannot be drawn, or no blast comes during the flight.
    """
    scenes = drawn_scenes(uncertain, vehicles, seed)
    scenes, notes = with_bursts_at_start(scenes, spec)
    seconds = flight_seconds(scenes, spec, uncertain.source, options)
    load = eqx.filter_vmap(_load)(scenes)
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
        ),
        notes,
    )


def flown_with(gains: Gains, flights: DrawnFlights) -> Trajectory:
    """Fly with some gains; pure, and differentiable by them."""
    count = flights.count
    start = jax.tree.map(
        lambda x: jnp.broadcast_to(x, (count, *x.shape)), flights.start
    )
    options = flights.options
    return simulate(
        flights.vehicle,
        start,
        duration_s=flights.seconds,
        step_s=options.step_s,
        integrator=options.integrator,
        control=PositionHold(flights.target_m, gains, flights.yaw_rad),
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


def _load(scene: Scene) -> FlightLoad:
    return load_of(scene, None)
