"""The answer of `jblast serve` with an autopilot in lockstep, or a ground station."""

from dataclasses import dataclass

from jblast.autopilot.ground_station import ServiceResult
from jblast.autopilot.lockstep import MOTOR_WORDS, Lockstep
from jblast.autopilot.mavlink import Link
from jblast.results import Document


@dataclass(frozen=True)
class LockstepAnswer(Document):
    """What came of a flight with an autopilot.

    Attributes:
        scene: The scene's file.
        seed: Of all that is drawn.
        vehicle: What flew.
        address: Where it was spoken.
        turns: Number of turns, 250 a second.
        flown: Of these, since the autopilot armed.
        seconds: How long the vehicle flew.
        late: Answers that came for an earlier turn, and were passed over.
        lost: Messages that are missing by the autopilot's own count.
        damaged: Messages with a wrong checksum.
        ended: Why it ended.
        position_m: Where the vehicle was then: east, north, up.
        files: That were written.
    """

    scene: str
    seed: int
    vehicle: str
    address: str
    turns: int
    flown: int
    seconds: float
    late: int
    lost: int
    damaged: int
    ended: str
    position_m: tuple[float, float, float]
    files: tuple[str, ...]


@dataclass(frozen=True)
class WatchedAnswer(Document):
    """What came of serving a ground station.

    Attributes:
        scene: The scene's file.
        seed: Of all that is drawn.
        vehicle: What flew.
        address: Where it was spoken.
        flights: How many were flown.
        items: Of the mission that it holds at the end.
        lost: Messages that are missing by the station's own count.
        damaged: Messages with a wrong checksum.
        ended: Why it ended.
    """

    scene: str
    seed: int
    vehicle: str
    address: str
    flights: int
    items: int
    lost: int
    damaged: int
    ended: str


def lockstep_answer(
    flight: Lockstep,
    link: Link,
    *,
    scene: str,
    seed: int,
    vehicle: str,
    files: list[str],
) -> LockstepAnswer:
    """Return what came of a flight with an autopilot."""
    east, north, up = (float(x) for x in flight.rows[-1].state[:3])
    return LockstepAnswer(
        scene=scene,
        seed=seed,
        vehicle=vehicle,
        address=str(link.address),
        turns=flight.turns,
        flown=flight.flown,
        seconds=flight.seconds,
        late=flight.late,
        lost=link.receiver.lost,
        damaged=link.receiver.damaged,
        ended=flight.ended,
        position_m=(east, north, up),
        files=tuple(files),
    )


def watched_answer(
    watched: ServiceResult,
    link: Link,
    *,
    scene: str,
    seed: int,
    vehicle: str,
    items: int,
) -> WatchedAnswer:
    """Return what came of serving a ground station."""
    return WatchedAnswer(
        scene=scene,
        seed=seed,
        vehicle=vehicle,
        address=str(link.address),
        flights=watched.flights,
        items=items,
        lost=link.receiver.lost,
        damaged=link.receiver.damaged,
        ended=watched.ended,
    )


def lockstep_line(vehicle: str, scene: str, address: str, *, listens: bool) -> str:
    """Return the line printed when an autopilot can connect."""
    how = "waits for an autopilot on" if listens else "speaks to an autopilot at"
    return (
        f"{vehicle} in {scene} {how} {address}: 250 samples a second in lockstep, "
        f"motors {MOTOR_WORDS}"
    )


def watched_line(vehicle: str, scene: str, address: str) -> str:
    """Return the line printed when a ground station can connect."""
    return f"{vehicle} in {scene} on {address}, for a ground station to arm"


def lockstep_text(answer: LockstepAnswer) -> str:
    """Return a flight with an autopilot, for a terminal."""
    place = ", ".join(f"{x:.3g}" for x in answer.position_m)
    lines = [
        f"{answer.vehicle.capitalize()} flown by an autopilot for {answer.seconds:g} s"
        f" to ({place}) m: {answer.ended}",
        f"{answer.turns:,} turns told, {answer.flown:,} flown, {answer.late:,} answers "
        f"late, {answer.lost:,} messages lost, {answer.damaged:,} damaged",
    ]
    if answer.files:
        lines.append(f"Written: {', '.join(answer.files)}")
    return "\n".join(lines) + "\n"


def watched_text(answer: WatchedAnswer) -> str:
    """Return the serving of a ground station, for a terminal."""
    return (
        f"{answer.vehicle.capitalize()} for a ground station on {answer.address}: "
        f"{answer.ended}\n{answer.flights} flights, {answer.items} items in its "
        f"mission, {answer.lost} messages lost, {answer.damaged} damaged\n"
    )
