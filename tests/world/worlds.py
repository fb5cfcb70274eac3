"""Worlds for tests: a few sensors, one of them on a vehicle."""

from typing import Any

from jblast.scene.reader import world_from_document
from jblast.world import DrawnWorld, draw_world

VEHICLE = {"model": "hummingbird", "position_m": [5.0, 0.0, 3.0]}
SENSORS = [
    {
        "name": "mic",
        "kind": "microphone",
        "mount": "vehicle",
        "offset_m": [0.2, 0.0, 0.1],
        "records": {"air_arrival_s": 1e-9, "ground_arrival_s": 1e-9},
    },
    {
        "name": "gauge",
        "kind": "pressure",
        "position_m": [40.0, 0.0, 1.5],
        "clock_offset_s": 0.25,
        "records": {"air_arrival_s": 1e-9},
    },
    {
        "name": "light",
        "kind": "flash",
        "position_m": [0.0, 900.0, 2.0],
        "records": {"flash_time_s": 1e-9},
    },
]
# sound without scatter, and with a solution in closed form
LAW = {"air_arrival_s": "acoustic", "scatter": False}


def document(**tables: Any) -> dict[str, Any]:
    """Return a scene file, some of its tables replaced."""
    usual = {"world": {}, "vehicle": VEHICLE, "sensor": SENSORS, "law": LAW}
    return usual | tables


def drawn(seed: int = 1, **tables: Any) -> DrawnWorld:
    """Return a world of such a file."""
    return draw_world(*world_from_document(document(**tables), "w.toml"), seed)
