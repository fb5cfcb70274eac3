"""What came of a mission as `jblast fly --json` prints it, key by key."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from jblast.json_values import plain
from jblast.report.flights.answer import (
    BlastMet,
    EastNorthUpM,
    EstimateThrown,
    Limit,
)


@dataclass(frozen=True)
class WaypointFlown:
    """One item as it was flown; one that is jumped back to is there again.

    Attributes:
        index: Number of the item in its plan.
        command: As MAVLink numbers it.
        reached: Whether the vehicle came within the acceptance radius.
        time_s: When, on the scene's clock; null: never.
        error_m: Least distance from it.
        path_error_rms_m: Of the distance from the set point on the way there.
        path_error_max_m: Likewise, the greatest.
    """

    index: int
    command: int
    reached: bool
    time_s: float
    error_m: float
    path_error_rms_m: float
    path_error_max_m: float


@dataclass(frozen=True)
class BlastFlownThrough:
    """What one blast did; null where it came before or after the flight.

    Attributes:
        charge: Its name; "" of one alone.
        waypoint: Number of the item it came on the way to.
        error_before_m: Path error as it came.
        peak_deviation_m: Greatest path error until the next blast, 10 s at most.
        peak_time_s: When, after it came.
        recovery_time_s: Until the path error stayed within the tolerance; null: it
            did not.
        recovered: Whether it did.
    """

    charge: str
    waypoint: int | None
    error_before_m: float
    peak_deviation_m: float
    peak_time_s: float
    recovery_time_s: float
    recovered: bool | None


@dataclass(frozen=True)
class MissionAnswer:
    """What was flown, what came, and what became of it.

    Attributes:
        scene: The scene's file.
        mission: The plan's file.
        seed: Of the priors.
        vehicle: What flew.
        home: Latitude, longitude [degree] and height [m] of where it stood.
        home_m: The same: east, north, up.
        seconds: How long, from calibration until a second after it was disarmed.
        step_s: Of the integrator, and of the controller.
        integrator: Which.
        backend: What calculated it.
        tolerance_m: Within which a vehicle has recovered.
        load: "laws", "custom profile" or the preset of a world.
        drawn: What was drawn of priors.
        completed: Whether it came to its end without a crash, each waypoint reached.
        disarmed_s: When its rotors were stopped after it had landed; null: never.
        crashed: Whether it crashed.
        crash: By what; "" if it did not.
        waypoints: Each item as it was flown.
        blasts: Each as it came.
        disturbances: What each did.
        estimator: "ekf", or "": it flew by the truth.
        estimates: What each blast did to the estimate; none by the truth.
        peak_overpressure_pa: Incident, of the strongest blast.
        peak_acceleration_m_s2: By the blasts alone.
        thresholds: Of these two, by exposure.
        warnings: Sentences on what the numbers do not tell.
    """

    scene: str
    mission: str
    seed: int
    vehicle: str
    home: tuple[float, float, float]
    home_m: EastNorthUpM
    seconds: float
    step_s: float
    integrator: str
    backend: str
    tolerance_m: float
    load: str
    drawn: Mapping[str, float]
    completed: bool
    disarmed_s: float
    crashed: bool
    crash: str
    waypoints: tuple[WaypointFlown, ...]
    blasts: tuple[BlastMet, ...]
    disturbances: tuple[BlastFlownThrough, ...]
    estimator: str
    estimates: tuple[EstimateThrown, ...]
    peak_overpressure_pa: float
    peak_acceleration_m_s2: float
    thresholds: Mapping[str, Limit]
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON can hold it; null is what is not a finite number."""
        return {f.name: plain(getattr(self, f.name)) for f in fields(self)}
