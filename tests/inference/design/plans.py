"""Layouts planned by hand for the tests of the bound."""

import numpy as np

from jblast.report.design import bound_view
from jblast.report.view import terminal
from jblast.scene import Air, Charge, Free, LogNormal, Scene, Sensor, UncertainScene

RING = {"a": (60.0, 0.0), "b": (-70.0, 30.0), "c": (0.0, 90.0), "d": (20.0, -80.0)}
MASS = {"charge_mass_kg": Free(positive=True)}
PLACE = {"charge_east_m": Free(positive=False), "charge_north_m": Free(positive=False)}
TIME = {"origin_time_s": Free(positive=False)}
ARRIVAL = (("air_arrival_s", 1e-4),)
PRESSURE = (("peak_overpressure_pa", 0.05),)
C = 340.0


def scene_of(beliefs, places, records=ARRIVAL, law=(), scatter=False, mass=10.0):
    """A scene of sensors by name; `records` of all, or of each by name."""
    return UncertainScene(
        Scene(
            Charge(mass_kg=mass),
            air=Air(sound_speed=C),
            sensors=tuple(
                Sensor(
                    name,
                    np.array([*place, 0.0]),
                    records=records[name] if isinstance(records, dict) else records,
                )
                for name, place in places.items()
            ),
            law=law,
            scatter=scatter,
        ),
        beliefs,
    )


def sentences(found):
    """The text for the terminal on one line, its columns checked."""
    text = terminal(bound_view(found))
    assert max(map(len, text.splitlines())) <= 96
    return " ".join(text.split())


TRUE = {"charge_mass_kg": 15.0, "charge_east_m": 5.0, "charge_north_m": 10.0}
PLAN = scene_of(
    MASS | PLACE | {"air_sound_speed_m_s": LogNormal(C, 1.01)},
    RING,
    {name: ARRIVAL + PRESSURE * (name in "ab") for name in RING},
    law=(("air_arrival_s", "kingery_bulmash"),),
    scatter=True,
)
