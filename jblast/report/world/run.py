"""What came of a world: everything that its folder and its summary tell."""

from dataclasses import dataclass, field
from typing import Any

from jblast.observations import Observations
from jblast.report.provenance import Provenance
from jblast.study.flights.records import Flights
from jblast.world import DrawnWorld, Perceived


@dataclass
class WorldRun:
    """A world that ran.

    Attributes:
        world: What was drawn.
        seconds: When it ended.
        perceived: Who perceived what and when, in order of time.
        late: What came after the end, and was not perceived.
        readings: What sensors wrote down; None: nothing.
        late_readings: Waves that came after the end, and were not written down.
        flights: Of the vehicle; None where nothing flew.
        made: What it is made of.
        flight: The document of the flights; None where nothing flew.
        sound: The document of the records of samples; None where there are none.
        imu: What each inertial measurement unit wrote; None where there is none.
        film: What the camera wrote; None where there is none.
        warnings: What else there is to know.
    """

    world: DrawnWorld
    seconds: float
    perceived: tuple[Perceived, ...]
    late: int
    readings: Observations | None
    late_readings: int
    flights: Flights | None
    made: Provenance
    flight: dict[str, Any] | None = None
    sound: dict[str, Any] | None = None
    imu: dict[str, Any] | None = None
    film: dict[str, Any] | None = None
    warnings: list[str] = field(default_factory=list)
