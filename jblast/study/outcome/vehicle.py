"""Effects of blasts on the scene's vehicle: deviation, recovery, survival, exposure.

Each sample is one flight under position control in the sample's wind, with integral
action unless the scene excludes it. It begins at 0 on the scene's clock and ends
`study.flights.AFTER_S` after the latest arrival among the pilot samples of the study.
These samples determine the duration of all flights. A sample whose blast arrives after
the end has no answer.
"""

from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jblast.scene import Scene, VehicleSpec
from jblast.scene.uncertain import with_values
from jblast.scene.values import finite
from jblast.study.flight_results import (
    TOLERANCE_M,
    Flown,
    Options,
    burst_remarks,
    load_of,
)
from jblast.study.flights import checked_scene, flight_seconds, flown_by
from jblast.study.outcome.family import (
    YES_NO,
    Answers,
    Prepared,
    Setting,
    family,
    yes_no,
)
from jblast.vehicle import controller_of
from jblast.vehicle.metrics import THRESHOLDS

STEP_S = 1e-3
"""Default time step [s]: its error is 0.12 mm
(`calibration/results/benchmark_flights.txt`)."""
OPTIONS = {
    "flight_step_s": f"step of the integrator [s] (default: {STEP_S:g})",
    "flight_tolerance_m": "path error within which a vehicle has recovered [m] "
    f"(default: {TOLERANCE_M:g})",
}
FLIGHTS_ON_DEVICE = 1 << 16
"""Flights on a GPU at a time, whose rows take about 3 GB."""


@family(
    "vehicle",
    2,
    {
        name: (units, f"{words}, of the scene's vehicle")
        for name, units, words in (
            ("peak_deviation_m", "m", "greatest path error after the blast"),
            (
                "recovery_time_s",
                "s",
                "time from the blast until back within the tolerance, if it recovers",
            ),
            ("recovers", YES_NO, "whether it returns to the tolerance and stays there"),
            ("flies_on", YES_NO, "whether it neither crashes nor diverges"),
            (
                "survives",
                YES_NO,
                "whether it flies on, below each threshold of its model",
            ),
            ("vehicle_overpressure_pa", "Pa", "incident peak overpressure"),
            ("vehicle_acceleration_m_s2", "m/s2", "peak acceleration by the blasts"),
            ("vehicle_fireball_time_s", "s", "time within a glowing fireball"),
        )
    },
    needs="[vehicle]",
    block=64,
    together=FLIGHTS_ON_DEVICE,
    options=OPTIONS,
)
def prepare(setting: Setting) -> Prepared:
    """Return the prepared flights of a scene.

    Raises:
        InputError: The scene cannot be flown.
    """
    uncertain = setting.uncertain

    def option(name: str, default: float) -> float:
        return finite(setting.options.get(name, default), f"[options] {name}")

    options = Options(
        step_s=option("flight_step_s", STEP_S),
        tolerance_m=option("flight_tolerance_m", TOLERANCE_M),
        backend="jax",
    )
    spec = checked_scene(uncertain, 1, False)
    pilot = {name: jnp.asarray(values) for name, values in setting.pilot.items()}
    some = _scenes(uncertain.scene, pilot)
    load, source = load_of(some, options), uncertain.source or "scene"
    seconds = flight_seconds(some, load, spec, source, options)
    hold = "without_integral" if spec.integral is False else "with_integral"
    control = controller_of(spec, hold)

    def batched(keys, numbers) -> Answers:
        # without parameters all samples are equal; the batch axis must still exist
        count = {"": jnp.zeros(keys.shape[0])}
        scenes = _scenes(uncertain.scene, numbers or count)
        load = load_of(scenes, options)
        flown = flown_by(scenes, load, spec, control, seconds, options)
        return {name: _answers(flown, spec, seconds)[name] for name in setting.names}

    words = hold.replace("_", " ")
    flights = f"flights of {seconds:g} s in steps of {options.step_s:g} s, {words}"
    notes = burst_remarks(some, spec)
    return Prepared(batched, notes=(f"{flights} action", *notes))


def _scenes(scene: Scene, numbers: Mapping[str, Array]) -> Scene:
    """Return the scenes of samples, with a leading axis in each array."""

    def one(values: Mapping[str, Array]) -> Scene:
        return with_values(scene, {k: v for k, v in values.items() if k})

    return eqx.filter_vmap(one)(dict(numbers))


def _answers(flown: Flown, spec: VehicleSpec, seconds: float) -> dict[str, Array]:
    """Return all outcomes; none for samples with an arrival outside of the flight."""
    metrics, exposure = flown.metrics, flown.exposure
    arrival = flown.encounter.arrival_s
    happens = arrival < jnp.inf
    known = jnp.all(~happens | ((arrival > 0) & (arrival < seconds)), axis=-1)
    recovered = jnp.isfinite(metrics.recovery_time_s) & ~metrics.crashed
    unharmed = jnp.ones_like(metrics.crashed)
    for name, limit in THRESHOLDS[spec.model].items():
        if limit.value is not None:
            # NaN of a diverged vehicle compares as false: it does not survive
            unharmed = unharmed & (getattr(exposure, name) <= limit.value)

    def number(values: Array, where: Array = known) -> Array:
        return jnp.where(where, values, jnp.nan)

    return {
        "peak_deviation_m": number(metrics.peak_deviation_m),
        "recovery_time_s": number(metrics.recovery_time_s, known & recovered),
        "recovers": yes_no(recovered, known),
        "flies_on": yes_no(~metrics.crashed, known),
        "survives": yes_no(~metrics.crashed & unharmed, known),
        "vehicle_overpressure_pa": number(exposure.peak_overpressure_pa),
        "vehicle_acceleration_m_s2": number(exposure.peak_acceleration_m_s2),
        "vehicle_fireball_time_s": number(exposure.fireball_time_s),
    }
