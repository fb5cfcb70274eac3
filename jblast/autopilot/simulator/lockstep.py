"""A flight in lockstep with an autopilot: it is told, it answers, the vehicle moves.

As PX4's simulator interface has it. Until the first controls come, samples go out by
the wall clock, so that the autopilot can start; from then on each turn waits for the
answer to its own HIL_SENSOR. The vehicle stands as if held, and the clock of the blasts
with it, until the autopilot has armed: so a flight does not hang on how long that took.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.autopilot.mavlink.link import Link, LinkLost
from jblast.autopilot.mavlink.wire import Message, Sender
from jblast.autopilot.simulator.readings import FIX, SENSOR, STATE
from jblast.autopilot.simulator.rotors import ARMED, LOCKSTEP, Rotors
from jblast.autopilot.simulator.stepping import PERIOD_S, Programs
from jblast.errors import InputError

SYSTEM, COMPONENT = 1, 51
"""Whom the simulator speaks for; MAV_COMP_ID_MISSIONPLANNER's neighbour, as others."""
PERIOD_US = 4000
FIRST_S = 1.0
"""How long the first answer is waited for: who is ready misses no turn."""
FIX_3D, SATELLITES = 3, 12
STATE_LENGTH = 17
"""Numbers of a state."""


class Row(NamedTuple):
    """One turn of a flight.

    Attributes:
        time_s: On the clock of the blasts.
        state: Position, velocity, quaternion, body rate, rotor speed, one after
            another.
        asked_rad_s: What the autopilot asked of the rotors.
    """

    time_s: float
    state: Float[np.ndarray, "17"]
    asked_rad_s: Float[np.ndarray, "4"]


@dataclass
class Lockstep:
    """How a flight went, while it goes and afterwards.

    Attributes:
        turns: That were told, and answered.
        flown: Of these, since the autopilot armed.
        late: Answers that came for an earlier turn, and were passed over.
        ended: Why it ended.
        rows: Of the flight.
    """

    turns: int = 0
    flown: int = 0
    late: int = 0
    ended: str = ""
    rows: list[Row] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """How long the vehicle has flown [s]."""
        return self.flown * PERIOD_S


def fly_lockstep(
    made: Programs,
    link: Link,
    rotors: Rotors,
    *,
    flight: Lockstep,
    seconds: float | None = None,
    patience_s: float = 60.0,
    each: Callable[[], object] = lambda: None,
) -> Lockstep:
    """Fly until the autopilot hangs up, does not answer, or the time is over.

    Args:
        made: The programs of the vehicle's turns.
        link: To an autopilot that is there.
        rotors: Which of the autopilot's motors turns which.
        flight: Of nothing so far; it is filled as the flight goes on.
        seconds: Of flight; None: no end.
        patience_s: How long an answer may take.
        each: Is called at the beginning of each turn.

    Returns:
        The flight; whatever ended it, its rows until then are there.
    """
    sender, still = Sender(SYSTEM, COMPONENT), np.zeros(4)
    carried, reported = made.first()
    numbers, heard = np.asarray(reported), False
    try:
        while seconds is None or flight.seconds < seconds - 0.5 * PERIOD_S:
            each()
            stamp = (flight.turns + 1) * PERIOD_US
            link.send(*_frames(sender, numbers, stamp))
            wait = patience_s if heard else PERIOD_S if flight.turns else FIRST_S
            answer = _answer(link, flight, stamp, wait)
            if answer is None and heard:
                flight.ended = f"no answer came within {patience_s:g} s"
                break
            goes, speeds = flight.flown > 0, still
            if answer is not None:
                heard = True
                armed = bool(answer.values["mode"] & ARMED)
                goes = goes or armed
                controls = np.array(answer.values["controls"][:4])
                speeds = rotors.speeds(controls) if armed else still
            if goes:
                flight.rows.append(Row(flight.seconds, numbers[-STATE_LENGTH:], speeds))
            carried, reported = made.after(
                carried, flight.turns, flight.flown, goes, speeds
            )
            numbers = np.asarray(reported)
            flight.turns += 1
            flight.flown += goes
        else:
            flight.ended = "the time is over"
    except (LinkLost, InputError) as end:
        flight.ended = str(end)
    except KeyboardInterrupt:
        flight.ended = "interrupted"
    flight.rows.append(Row(flight.seconds, numbers[-STATE_LENGTH:], still))
    return flight


def _answer(link: Link, flight: Lockstep, stamp: int, wait_s: float) -> Message | None:
    """Return the controls that answer a turn; None where none come in time.

    Raises:
        LinkLost: The autopilot has gone.
        InputError: It does not go in lockstep, or answers what was not asked.
    """
    until = time.monotonic() + wait_s
    while (left := until - time.monotonic()) > 0:
        message = link.receive(left)
        if message is None:
            return None
        if message.name != "HIL_ACTUATOR_CONTROLS":
            continue
        said = message.values
        if not said["flags"] & LOCKSTEP:
            raise InputError(
                "expected an autopilot in lockstep, bit 0 of the flags of "
                f"HIL_ACTUATOR_CONTROLS, got flags {said['flags']}: PX4 is to be built "
                "with lockstep, as its SITL is by default"
            )
        if said["time_usec"] > stamp:
            raise InputError(
                f"expected controls for {stamp} us at most, the time that was told, got"
                f" some for {said['time_usec']} us: messages out of order"
            )
        if said["time_usec"] < stamp:
            flight.late += 1
            continue
        return message
    return None


def _frames(
    sender: Sender, numbers: Float[np.ndarray, " number"], stamp: int
) -> list[bytes]:
    """Return the messages of a turn; the sensors' comes last, as it is waited for."""
    sensor, rest = numbers[: len(SENSOR)], numbers[len(SENSOR) :]
    fix, rest = rest[: len(FIX)], rest[len(FIX) :]
    state, has_fix = rest[: len(STATE)], rest[len(STATE)]
    said = {name: int(x) for name, x in zip(STATE[7:], state[7:], strict=True)}
    speeds = dict(zip(STATE[4:7], state[4:7].tolist(), strict=True))
    frames = []
    if has_fix:
        whole = {name: int(x) for name, x in zip(FIX, fix, strict=True)}
        frames.append(
            sender.pack(
                "HIL_GPS",
                time_usec=stamp,
                fix_type=FIX_3D,
                satellites_visible=SATELLITES,
                **whole,
            )
        )
    frames.append(
        sender.pack(
            "HIL_STATE_QUATERNION",
            time_usec=stamp,
            attitude_quaternion=state[:4].tolist(),
            **speeds,
            **said,
        )
    )
    values: dict[str, float | int] = dict(zip(SENSOR, sensor.tolist(), strict=True))
    values["fields_updated"] = int(values["fields_updated"])
    return [*frames, sender.pack("HIL_SENSOR", time_usec=stamp, **values)]
