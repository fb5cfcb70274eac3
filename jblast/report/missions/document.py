"""What is to be told of a mission."""

import math

import numpy as np

from jblast.missions.frame import geodetic
from jblast.report.flights.answer import BlastMet, EstimateThrown, Limit
from jblast.report.flights.estimates import estimates_thrown
from jblast.report.missions.answer import (
    BlastFlownThrough,
    MissionAnswer,
    WaypointFlown,
)
from jblast.study.missions.records import Disturbance, MissionFlight
from jblast.vehicle.thresholds import THRESHOLDS


def mission_answer(flight: MissionFlight, *, scene: str, seed: int) -> MissionAnswer:
    """Return what is to be told of a mission.

    Args:
        flight: What was flown.
        scene: The file that says through what.
        seed: Of what was drawn.
    """
    options, mission = flight.options, flight.mission
    limits = THRESHOLDS[flight.vehicle.model]
    judged = ("peak_overpressure_pa", "peak_acceleration_m_s2")
    lat, lon, alt = geodetic(mission.frame, mission.home_m).tolist()
    east, north, up = mission.home_m.tolist()
    return MissionAnswer(
        scene=scene,
        mission=mission.plan.source,
        seed=seed,
        vehicle=flight.vehicle.model,
        home=(lat, lon, alt),
        home_m=(east, north, up),
        seconds=flight.seconds,
        step_s=options.step_s,
        integrator=options.integrator,
        backend=options.backend,
        tolerance_m=options.tolerance_m,
        load=options.load if options.profile is None else "custom profile",
        drawn=flight.drawn,
        completed=flight.completed,
        disarmed_s=flight.disarmed_s,
        crashed=bool(flight.crash),
        crash=flight.crash,
        waypoints=tuple(
            WaypointFlown(
                one.item.number,
                one.item.command,
                one.reached,
                one.time_s,
                one.error_m,
                one.path_error_rms_m,
                one.path_error_max_m,
            )
            for one in flight.waypoints
        ),
        blasts=tuple(
            _met(flight, n, one.charge) for n, one in enumerate(flight.disturbances)
        ),
        disturbances=tuple(_through(flight, one) for one in flight.disturbances),
        estimator=options.estimator,
        estimates=_estimates(flight),
        peak_overpressure_pa=float(flight.exposure.peak_overpressure_pa),
        peak_acceleration_m_s2=float(flight.exposure.peak_acceleration_m_s2),
        thresholds={n: Limit(limits[n].value, limits[n].source) for n in judged},
        warnings=tuple(mission_warnings(flight)),
    )


def mission_warnings(flight: MissionFlight) -> list[str]:
    """Return sentences on what the numbers do not tell by themselves."""
    said = list(flight.notes)
    plan = flight.mission.plan
    said += [
        f"{plan.source} has {part}, which is not heeded" for part in plan.not_flown
    ]
    if flight.crash:
        said.append(f"the vehicle {flight.crash}: what it did afterwards is no flight")
    elif math.isnan(flight.disarmed_s):
        said.append("it was cut off before it had landed")
    outside = ~np.asarray(flight.encounter.in_range)
    for one, away in zip(flight.disturbances, outside, strict=True):
        name = f"blast {one.charge}" if one.charge else "the blast"
        if one.waypoint < 0:
            said.append(f"{name} comes before or after the flight")
        elif away:
            known = "its laws hold" if flight.options.profile is None else "has cases"
            said.append(
                f"{name} comes from where no "
                + ("laws hold" if known.startswith("its") else "profile has cases")
                + ": its load is finite, no more"
            )
    return said


def _met(flight: MissionFlight, n: int, name: str) -> BlastMet:
    came = flight.encounter
    return BlastMet(
        charge=name,
        arrival_s=float(came.arrival_s[n]),
        distance_m=float(came.distance_m[n]),
        scaled_distance=float(came.scaled_distance[n]),
        overpressure_pa=float(came.overpressure_pa[n]),
        in_range=bool(came.in_range[n]),
    )


def _estimates(flight: MissionFlight) -> tuple[EstimateThrown, ...]:
    """Return what each blast did to the estimate; nothing by the truth."""
    if flight.thrown is None:
        return ()
    names = [one.charge for one in flight.disturbances]
    return estimates_thrown(flight.thrown, names, float)


def _through(flight: MissionFlight, one: Disturbance) -> BlastFlownThrough:
    flown = one.waypoint >= 0
    return BlastFlownThrough(
        one.charge,
        flight.waypoints[one.waypoint].item.number if flown else None,
        one.error_before_m,
        one.peak_deviation_m,
        one.peak_time_s,
        one.recovery_time_s,
        math.isfinite(one.recovery_time_s) if flown else None,
    )
