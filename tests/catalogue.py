"""Logs that tests share: their values vary, their rows do not.

Other rows, other unknowns or other laws are other programs, which compile for seconds;
the same rows with other values are the same program. So a test takes its log from here
where it can, and says in it what it wants by values. What is solved is solved once.
"""

import numpy as np

from jblast.observations import Observations
from jblast.scene import Air, Charge, Free, Scene, UncertainScene, freed, with_laws
from jblast.waves import (
    kingery_bulmash_pressure,
    shock_kinematics_arrival_time,
    wu_hao_air_arrival_time,
    wu_hao_ground_arrival_time,
)
from tests.inference.logs import log

AROUND = ((60.0, 0.0), (-70.0, 30.0), (0.0, 90.0), (20.0, -80.0), (120.0, 100.0))
"""Five microphones about a charge, east and north [m]."""
BOTH = (("air_arrival_s", 1e-4), ("peak_overpressure_pa", 0.02))
"""What each records, and its sigma."""
TRUTH = {
    "charge_mass_kg": 30.0,
    "charge_east_m": 10.0,
    "charge_north_m": -5.0,
    "origin_time_s": 1.5,
}
"""The charge among them."""

EXACT = Scene(scatter=False)
MASS_FREE = UncertainScene(EXACT, {"charge_mass_kg": Free(positive=True)})
"""A charge of unknown mass, laws without scatter."""


def pressures(mass, ranges=(10.0, 20.0, 40.0), sigma=0.1) -> Observations:
    """Pressures without error at some ranges, three where nothing else is wanted.

    Args:
        mass: Of the charge, or of that at each range [kg].
        ranges: Slant ranges [m].
        sigma: Of ln p.
    """
    masses = np.broadcast_to(mass, len(ranges))
    values = np.asarray(kingery_bulmash_pressure(np.array(ranges, float), masses))
    return log(
        *(
            (f"s{i}", "peak_overpressure_pa", p, sigma * p, r)
            for i, (r, p) in enumerate(zip(ranges, values.tolist(), strict=True))
        ),
        at_range=True,
    )


TEN = tuple(np.linspace(10.0, 40.0, 10).tolist())
"""Ranges of ten pressures, some of which may contradict the others [m]."""

SOUND_SPEED, KNOWN_MASS = 340.0, 10.0
TIMED = Scene(
    Charge(mass_kg=KNOWN_MASS),
    air=Air(sound_speed=SOUND_SPEED),
    law=(("air_arrival_s", "shock_kinematics"),),
    scatter=False,
)
"""What `arrivals` are of, but for the place."""
PLACE = ["charge_east_m", "charge_north_m"]
PLACE_FREE = freed(UncertainScene(TIMED), PLACE)


def travel_time(distance: float) -> float:
    """Return how long the shock takes [s]."""
    return float(
        shock_kinematics_arrival_time(distance, KNOWN_MASS, 101325.0, SOUND_SPEED)
    )


def arrivals(places, east: float, north: float, time: float = 0.0) -> Observations:
    """Arrivals without error of a charge at a place, at three or four others.

    Args:
        places: East and north of each sensor [m].
        east: Of the charge [m].
        north: Of the charge [m].
        time: At which it explodes [s].
    """
    return log(
        *(
            ("abcd"[i], "air_arrival_s", time + t, 1e-4, (*place, 0.0))
            for i, place in enumerate(places)
            for t in [travel_time(float(np.hypot(place[0] - east, place[1] - north)))]
        )
    )


LINE = ((-100.0, 0.0), (0.0, 0.0), (150.0, 0.0))
TRIANGLE = ((-100.0, -40.0), (0.0, 120.0), (150.0, -30.0))
"""Three sensors in a line, and about a charge, east and north [m]."""


WU_HAO = with_laws(
    freed(MASS_FREE, ["air_sound_speed_m_s", "ground_p_speed_m_s"]),
    {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"},
)
"""Asks `wu_hao_arrivals` for what they cannot tell."""


def wu_hao_arrivals(ranges) -> Observations:
    """Arrivals of 15 kg through air and ground at some ranges, without error."""
    rows = []
    for i, r in enumerate(ranges):
        air = float(wu_hao_air_arrival_time(r, 15.0, 340.0))
        ground = float(wu_hao_ground_arrival_time(r, 15.0, 6000.0))
        rows += [
            (f"s{i}", "air_arrival_s", air, 1e-4, r),
            (f"s{i}", "ground_arrival_s", ground, 1e-5, r),
        ]
    return log(*rows, at_range=True)


def disagreeing(apart: float) -> Observations:
    """Three pressures of a mass, and two of one so much larger in ln."""
    masses = 15.0 * np.exp([0.0, 0.0, 0.0, apart, apart])
    return pressures(masses, (10.0, 20.0, 40.0, 15.0, 30.0), sigma=0.3)
