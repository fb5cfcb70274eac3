"""Text of `jblast serve` with an autopilot in lockstep, or a ground station."""

from jblast.study.mavlink_servers import LockstepAnswer, WatchedAnswer


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
