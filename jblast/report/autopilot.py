"""The answer of `jblast serve` with an autopilot in lockstep, or a ground station."""

from dataclasses import dataclass

from jblast.autopilot.ground_station import ServiceResult
from jblast.autopilot.lockstep import MOTOR_WORDS, Lockstep
from jblast.autopilot.mavlink import Link
from jblast.results import Document


@dataclass(frozen=True)
class LockstepAnswer(Document):
    """Result of a flight with an autopilot in lockstep.

    Attributes:
        scene: The scene's file.
        seed: Seed of all random draws.
        vehicle: The vehicle.
        address: Address of the connection.
        turns: Number of steps, 250 per second.
        flown: Number of steps since the autopilot armed.
        seconds: Time of flight.
        late: Number of ignored answers, which came for an earlier step.
        lost: Number of missing messages, by the autopilot's count.
        damaged: Number of messages with a wrong checksum.
        ended: Reason for the end of the flight.
        position_m: Final position of the vehicle: east, north, up.
        files: Files that were written.
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
    """Result of serving a ground station.

    Attributes:
        scene: The scene's file.
        seed: Seed of all random draws.
        vehicle: The vehicle.
        address: Address of the connection.
        flights: Number of flights.
        items: Number of mission items at the end.
        lost: Number of missing messages, by the station's count.
        damaged: Number of messages with a wrong checksum.
        ended: Reason for the end of the connection.
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
    """Return the result of a flight with an autopilot."""
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
    """Return the result of serving a ground station."""
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
    link = "waits for an autopilot on" if listens else "connects to an autopilot at"
    return (
        f"{vehicle} in {scene} {link} {address}: 250 samples a second in lockstep, "
        f"motors {MOTOR_WORDS}"
    )


def watched_line(vehicle: str, scene: str, address: str) -> str:
    """Return the line printed when a ground station can connect."""
    return f"{vehicle} in {scene} on {address}, for a ground station to arm"


def lockstep_text(answer: LockstepAnswer) -> str:
    """Return the result of a flight with an autopilot, for the terminal."""
    place = ", ".join(f"{x:.3g}" for x in answer.position_m)
    lines = [
        f"{answer.vehicle.capitalize()} flown by an autopilot for {answer.seconds:g} s"
        f" to ({place}) m: {answer.ended}",
        f"{answer.turns:,} steps, {answer.flown:,} of them in flight; late answers "
        f"{answer.late:,}, lost messages {answer.lost:,}, damaged messages "
        f"{answer.damaged:,}",
    ]
    if answer.files:
        lines.append(f"Written: {', '.join(answer.files)}")
    return "\n".join(lines) + "\n"


def watched_text(answer: WatchedAnswer) -> str:
    """Return the result of serving a ground station, for the terminal."""
    flights, items, messages = (
        f"{count} {noun}{'' if count == 1 else 's'}"
        for count, noun in (
            (answer.flights, "flight"),
            (answer.items, "mission item"),
            (answer.lost, "message"),
        )
    )
    return (
        f"{answer.vehicle.capitalize()} for a ground station on {answer.address}: "
        f"{answer.ended}\n{flights}, {items}, {messages} lost, {answer.damaged} "
        "damaged\n"
    )
