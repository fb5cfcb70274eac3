"""The layouts of `efficiency.py`: who records what, by which law, of which blast.

Nothing has a prior. The laws hold at every sensor, but for Wu and Hao's in the air,
which is slower than sound from 81 m; truth and fit have the same.

A buried charge whose impulses and durations alone are recorded is not among them: two
numbers, the level of either, are all that `ford_2021` makes of mass and height, and two
charges have the same: 300 kg 1.5 m deep and 61 kg 4.2 m above ground (one standard
deviation of ln mass is 0.09). The second lies outside of what the law was taught, so
`bound` rightly names no ambiguity, but `fit_many` knows no ranges and, without a prior,
returns either. Here a flash and arrivals at 1 ms tell the two apart.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from calibration.six_stations import DISTANCES
from jblast.scene import Scene, Sensor, with_values
from jblast.verification.sampling_cases import PLACES as FIVE

MASS = {"charge_mass_kg": 30.0}
PLACE = {"charge_east_m": 10.0, "charge_north_m": -5.0}
TIME = {"origin_time_s": 1.5}
BURIED = {"charge_mass_kg": 300.0, "charge_up_m": -1.5}
CLOCK = 1e-4
TURN = 2.4
"""Angle between the directions of sensors at one distance after another [rad]."""

Places = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Case:
    """A blast and those who record it.

    Attributes:
        places: East and north of each sensor [m].
        records: What each records, and its error: seconds for times, else relative.
        laws: Name of the law for each quantity.
        truth: The numbers sought.
        up: Height of the sensors [m].
    """

    places: Places
    records: Mapping[str, float]
    laws: Mapping[str, str]
    truth: Mapping[str, float]
    up: float = 1.5

    def scene(self, *, scatter: bool) -> Scene:
        """Return the scene, laws exact or scattering."""
        sensors = tuple(
            Sensor(
                f"s{i}",
                jnp.array([*place, self.up]),
                records=tuple(self.records.items()),
            )
            for i, place in enumerate(self.places)
        )
        empty = dataclasses.replace(Scene(), scatter=scatter, sensors=sensors)
        return with_values(empty, self.truth)

    def yardsticks(self) -> dict[str, float]:
        """Return what each number's spread is measured by: 1 for one fitted in ln.

        A place is measured by the nearest slant range, the origin time by what sound
        needs for it.
        """
        scene = self.scene(scatter=False)
        charge, speed = scene.charge, self.truth.get("air_sound_speed_m_s", 340.0)
        here = np.array(charge.position_m, float)
        near = min(
            float(np.linalg.norm(np.asarray(sensor.position_m) - here))
            for sensor in scene.sensors
        )
        told = {"origin_time_s": near / speed}
        told |= dict.fromkeys(("charge_east_m", "charge_north_m", "charge_up_m"), near)
        return {name: told.get(name, 1.0) for name in self.truth}


def spiral(distances: Sequence[float], turn: float = TURN) -> Places:
    """Return places at distances from the origin, each some way round from the last."""
    return [
        (float(d * np.cos(i * turn)), float(d * np.sin(i * turn)))
        for i, d in enumerate(distances)
    ]


LINE = spiral((20, 35, 60, 90, 140, 200))
CLOSE = spiral((20, 30, 40, 50, 60, 70))
FAR = spiral((200, 300, 400, 500, 700, 1000, 1300, 2000))
MANY = spiral(np.linspace(40, 160, 24).tolist())
KINEMATICS = {
    quantity: "shock_kinematics"
    for quantity in ("air_arrival_s", "peak_overpressure_pa")
}
ARRIVAL = {"air_arrival_s": CLOCK}
HEARD = {"air_arrival_s": CLOCK, "peak_overpressure_pa": 0.02}
SEEN = {"flash_time_s": CLOCK, "air_arrival_s": CLOCK}
PULSE = {"positive_impulse_pa_s": 0.05, "positive_duration_s": 0.05}
GROUND = {"air_arrival_s": CLOCK, "ground_arrival_s": CLOCK}
SOUND = {"air_sound_speed_m_s": 340.0}

CASES = {
    "arrivals": Case(LINE, ARRIVAL, KINEMATICS, MASS | TIME),
    "arrivals at 1 ms": Case(LINE, {"air_arrival_s": 1e-3}, KINEMATICS, MASS | TIME),
    "arrivals and sound speed": Case(LINE, ARRIVAL, KINEMATICS, MASS | TIME | SOUND),
    "flash and air": Case(
        FIVE, SEEN, KINEMATICS | {"flash_time_s": "light"}, MASS | PLACE | TIME
    ),
    "microphones": Case(FIVE, HEARD, KINEMATICS, MASS | PLACE | TIME),
    "24 microphones": Case(MANY, HEARD, KINEMATICS, MASS | PLACE | TIME),
    "impulse and duration": Case(
        CLOSE, PULSE, dict.fromkeys(PULSE, "kingery_bulmash"), MASS | PLACE
    ),
    "pressure": Case(
        CLOSE,
        {"peak_overpressure_pa": 0.05},
        {"peak_overpressure_pa": "kingery_bulmash"},
        MASS | PLACE,
    ),
    "burial": Case(
        FAR,
        PULSE | {"flash_time_s": 1e-3, "air_arrival_s": 1e-3},
        KINEMATICS | dict.fromkeys(PULSE, "ford_2021") | {"flash_time_s": "light"},
        BURIED | TIME,
        up=0.0,
    ),
    "air and ground": Case(
        spiral(DISTANCES, np.pi / 3),
        GROUND,
        dict.fromkeys(GROUND, "wu_hao"),
        MASS | PLACE | TIME,
        up=0.0,
    ),
}
"""By name. "microphones" is the layout of `coverage`, "air and ground" that of the
benchmark `fit_many`."""
