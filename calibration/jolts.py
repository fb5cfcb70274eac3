"""How far is the jolt that an IMU gives from the one that the forward model gives?

    python -m calibration.jolts > calibration/results/jolts.txt

Vehicles hover at a place, are flown through a blast with their position hold, and are
read by an IMU of 1 kHz, 5 cm ahead of the centre of mass. Its jolt is picked, once
without errors and once with those of the default IMU, and held against
`jolt_velocity_m_s` and its direction by `sensors.record`, which lets the wave come to a
vehicle that hovers on, its rotors as they were. What is between is the share that
`sensors.jolt_pick.MODEL_SHARE` declares: turning, rotors, hold, and the flight's steps.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.scene import Charge, Imu, Scene, Sensor, VehicleSpec
from jblast.sensors import planned_layout, record
from jblast.sensors.imu import Inertial, inertial_of, states_at, with_errors
from jblast.sensors.jolt_pick import JoltPick, pick_jolt
from jblast.vehicle import blast_load, hold_of, simulate, start_of, vehicle_of

QUANTITIES: tuple[str, ...] = (
    "jolt_velocity_m_s",
    "jolt_bearing_rad",
    "jolt_elevation_rad",
)
MODELS = ("hummingbird", "crazyflie", "iris")
BLASTS = ((15.0, 8.0), (5.0, 10.0), (15.0, 15.0), (10.0, 25.0), (5.0, 40.0))
"""Mass [kg] and horizontal distance [m]."""
UP, BLAST_S, SECONDS = 4.0, 0.3, 0.9
OFFSET = jnp.array([0.05, 0.0, 0.0])
LEVEL = jnp.array([0.0, 0.0, 0.0, 1.0])
SAMPLES = 800
PERFECT = Imu(bits=None, accelerometer_noise=0.0, gyroscope_noise=0.0)


def scene_of(model: str, mass: float, distance: float) -> Scene:
    """Return a vehicle that hovers beside a charge."""
    place = jnp.array([0.8 * distance, 0.6 * distance, UP])
    records = tuple((quantity, 0.01) for quantity in QUANTITIES)
    return Scene(
        Charge(mass, (0.0, 0.0, 0.0), BLAST_S, burst="surface"),
        vehicle=VehicleSpec(model, place),
        sensors=(Sensor("imu", place, records=records),),
    )


def picked(scene: Scene, seeds: int) -> list[JoltPick | str]:
    """Return the jolt without errors, then with those of some seeds."""
    spec = scene.vehicle
    assert spec is not None
    vehicle, start, imu = vehicle_of(spec), start_of(spec), PERFECT
    flight = simulate(
        vehicle,
        start,
        duration_s=SECONDS,
        control=hold_of(spec, integral=False),
        loads=(blast_load(scene),),
        ground_up_m=0.0,
    )
    edges = jnp.arange(SAMPLES + 1.0) / imu.rate
    true = inertial_of(flight, edges, OFFSET, LEVEL)
    middle = (edges[1:] + edges[:-1]) / 2
    turns = states_at(flight, middle).rotor_speed_rad_s
    tries: list[tuple[Inertial, Imu]] = [(true, imu)]
    real = Imu()
    tries += [(with_errors(jax.random.key(n), real, true), real) for n in range(seeds)]
    return [
        pick_jolt(samples, one, vehicle, start, turns, OFFSET, LEVEL)
        for samples, one in tries
    ]


def main() -> None:
    """Print the table."""
    start_jax(quick=True)
    print(
        "jolt by sensors.record; what the IMU's without errors is off; sd with errors"
    )
    print()
    print(
        f"{'':12}{'kg':>4}{'m':>5}{'m/s':>8}{'off':>8}{'bearing':>9}{'elevation':>11}"
        f"{'sd':>10}{'off/sd':>8}"
    )
    worst = 0.0
    for model in MODELS:
        for mass, distance in BLASTS:
            scene = scene_of(model, mass, distance)
            layout, _, _ = planned_layout(scene)
            laws = dict.fromkeys(QUANTITIES, "blast_load")
            speed, bearing, elevation = np.asarray(record(scene, layout, laws).value)
            true, *tries = picked(scene, 8)
            if isinstance(true, str):
                print(f"{model:12}{mass:4.0f}{distance:5.0f}{speed:8.4f}  {true}")
                continue
            share = true.speed_m_s[0] / speed - 1
            worst = max(worst, abs(share))
            picks = [one for one in tries if isinstance(one, JoltPick)]
            found = [one for one in picks if not one.clipped]
            off = [(one.speed_m_s[0] - true.speed_m_s[0]) / one.sd_m_s for one in found]
            noise = np.mean([one.sd_m_s for one in found]) if found else np.nan
            spread = np.sqrt(np.mean(np.square(off))) if found else np.nan
            why = {one if isinstance(one, str) else "clipped" for one in tries}
            print(
                f"{model:12}{mass:4.0f}{distance:5.0f}{speed:8.4f}{share:8.1%}"
                f"{true.bearing_rad[0] - bearing:9.4f}"
                f"{true.elevation_rad[0] - elevation:11.4f}"
                f"{noise:10.5f}{spread:8.2f}"
                + ("" if found else f"  {', '.join(sorted(why))}")
            )
    print()
    print(f"largest share left out {worst:.1%}")


if __name__ == "__main__":
    main()
