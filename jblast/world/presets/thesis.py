"""What Parab's thesis prints, and what its plugins compute, as presets.

Printed: Parab (2024), eqs. 3.1 to 3.5, algorithm 4, section 4.2.1. Coded: facts read
from charlotte-visionlab/gazebo_blast3d, `e6dd04c` and its state of July 2025, which are
GPL: nothing of them is copied. Laws "thesis_..." stand in `waves/laws/thesis.py`, loads
in `vehicle/loads/thesis`.
"""

from jblast.world.presets.preset import Preset

SOUND = (
    "peak_overpressure_pa",
    "positive_duration_s",
    "positive_impulse_pa_s",
)
AIR = {"sound_speed_m_s": 340.0, "absorption": False}
"""Called the speed of sound in dry air at 20 C; Stokes' absorption is in the laws."""

TICKS = {"probability": 0.15, "tick_s": 0.5, "gap_s": 0.5}
"""The plugin's: algorithm 4 has no numbers."""


def _laws(sound: str) -> dict[str, object]:
    arrivals = dict.fromkeys(("air_arrival_s", "ground_arrival_s"), "wu_hao")
    return {**arrivals, **dict.fromkeys(SOUND, sound), "scatter": False}


PRINTED = Preset(
    name="thesis-as-printed",
    source="Parab's thesis, eqs. 3.1 to 3.5 and section 4.2.1",
    physics={
        "air": AIR,
        "ground": {"p_speed_m_s": 6000.0, "path": "head"},
        "law": _laws("thesis_as_printed"),
    },
    world={
        **TICKS,
        "region_m": {"ring": [10.0, 20.0]},
        "about": "world",
        "mass_kg": {"uniform": [5.0, 15.0]},
        "time_s": {"uniform": [1.0, 20.0]},
    },
    load="thesis-as-printed",
)

CODED = Preset(
    name="thesis-as-coded",
    source="gazebo_blast3d of July 2025, as read",
    physics={
        "air": AIR,
        "ground": {"p_speed_m_s": 6000.0, "path": "thesis"},
        "law": _laws("thesis_as_coded"),
    },
    world={
        **TICKS,
        "region_m": {"box": [[10.0, 10.0, 10.0], [20.0, 20.0, 20.0]]},
        "about": "vehicle",
        "mass_kg": {"uniform": [10.0, 11.0]},
        "time_s": {"uniform": [1.0, 20.0]},
    },
    load="thesis-as-coded",
    pressure_speed_m_s=300.0,
    frame_differences=True,
)

PRESETS = {preset.name: preset for preset in (PRINTED, CODED)}
