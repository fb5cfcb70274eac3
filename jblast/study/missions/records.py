"""What came of a mission through blasts."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jblast.autopilot.estimator import Followed, Thrown
from jblast.missions import GuidanceHistory, Item, Mission
from jblast.scene import VehicleSpec
from jblast.study.flights.encounter import Encounter
from jblast.study.flights.exposure import Exposure
from jblast.study.flights.records import Options
from jblast.vehicle import Trajectory


@dataclass(frozen=True)
class Waypoint:
    """One item as it was flown; an item that is jumped back to is there again.

    Attributes:
        item: Of the plan.
        goal_m: Where to: east, north, up.
        reached: Whether the vehicle came within the acceptance radius; of a landing,
            whether it stood on the ground and its rotors as well.
        time_s: When; NaN: never.
        error_m: Least distance from it; of a landing, over ground at its end.
        path_error_rms_m: Root mean square of the distance from the set point on the
            way there; NaN: it was not set out for.
        path_error_max_m: The greatest.
    """

    item: Item
    goal_m: Float[np.ndarray, "3"]
    reached: bool
    time_s: float
    error_m: float
    path_error_rms_m: float
    path_error_max_m: float


@dataclass(frozen=True)
class Disturbance:
    """What one blast did to the flight.

    Attributes:
        charge: Its name; "" of one alone.
        waypoint: On the way to which, from 0; -1: before or after the flight.
        error_before_m: Path error as it came.
        peak_deviation_m: Greatest path error until the next blast, 10 s at most.
        peak_time_s: When, after it came.
        recovery_time_s: From its arrival until the path error stayed within the
            tolerance, over the same time; 0: it never left; infinite: it did not.
    """

    charge: str
    waypoint: int
    error_before_m: float
    peak_deviation_m: float
    peak_time_s: float
    recovery_time_s: float


@dataclass(frozen=True)
class MissionFlight:
    """A mission that was flown.

    Attributes:
        vehicle: What the scene says of it.
        mission: What it was to fly.
        options: How it was flown.
        integral: Whether its hold has integral action.
        seconds: How long, until a second after it was disarmed, or cut off.
        drawn: What was drawn, by name of `scene.PARAMETERS`.
        places_m: Of the charges, east, north, up.
        wind_m_s: Towards east, north.
        trajectory: A row each time that its controller was asked.
        guided: What the guidance said at each row.
        path_error_m: Distance from the set point at each row.
        encounter: How the blasts came to it.
        exposure: What they did to it beside moving it.
        waypoints: Each item as it was flown, in order.
        disturbances: By blast.
        thrown: What the blasts did to its estimate; None: it flew by the truth.
        followed: What it took for its state at each row; None: the truth.
        disarmed_s: When it was disarmed; NaN: never.
        crash: What it crashed by; "" if it did not.
        notes: What there is to say besides.
    """

    vehicle: VehicleSpec
    mission: Mission
    options: Options
    integral: bool
    seconds: float
    drawn: dict[str, float]
    places_m: Float[np.ndarray, "blast 3"]
    wind_m_s: Float[np.ndarray, "2"]
    trajectory: Trajectory
    guided: GuidanceHistory
    path_error_m: Float[np.ndarray, " time"]
    encounter: Encounter
    exposure: Exposure
    waypoints: tuple[Waypoint, ...]
    disturbances: tuple[Disturbance, ...]
    thrown: Thrown | None
    followed: Followed | None
    disarmed_s: float
    crash: str
    notes: tuple[str, ...]

    @property
    def completed(self) -> bool:
        """Whether it came to its end without a crash, each waypoint reached."""
        reached = all(waypoint.reached for waypoint in self.waypoints)
        return not self.crash and bool(np.isfinite(self.disarmed_s)) and reached
