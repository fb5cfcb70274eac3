"""Commands that an item of a plan may give, as MAVLink numbers them (MAV_CMD).

Numbers and meaning of parameters are those of MAVLink's common.xml, from memory; what
a multicopter makes of them is PX4's, or ArduCopter's for turns, and stands with each.
"""

from typing import NamedTuple


class Command(NamedTuple):
    """A command that is flown.

    Attributes:
        number: Of MAV_CMD.
        name: Its name there, without what all begin with.
        placed: Whether it says a place: "always", "may" (0, 0 or nothing is where the
            vehicle is), "never".
        used: Which of its parameters 1 to 4 are flown; the others must be 0 or absent.
    """

    number: int
    name: str
    placed: str
    used: tuple[int, ...]


WAYPOINT, LOITER, TURNS, LOITER_TIME = 16, 17, 18, 19
RETURN, LAND, TAKEOFF, JUMP, SPEED = 20, 21, 22, 177, 178

COMMANDS = {
    command.number: command
    for command in (
        # hold [s], acceptance radius [m], -, yaw [degree, clockwise from north]
        Command(WAYPOINT, "waypoint", "always", (1, 2, 4)),
        # a multicopter loiters on the spot, whatever the radius
        Command(LOITER, "loiter", "always", (3, 4)),
        # turns, heading to leave by, radius [m] (positive: clockwise), where to leave:
        # it leaves where it came in
        Command(TURNS, "loiter for turns", "always", (1, 2, 3, 4)),
        # time [s], the same three, without a meaning on the spot
        Command(LOITER_TIME, "loiter for a time", "always", (1, 2, 3, 4)),
        Command(RETURN, "return to launch", "never", ()),
        # -, -, -, yaw
        Command(LAND, "land", "may", (4,)),
        # pitch, of those with wings, -, -, yaw
        Command(TAKEOFF, "take-off", "may", (1, 4)),
        # number of the item to go to, how many times
        Command(JUMP, "jump", "never", (1, 2)),
        # 0 or 1: over ground, 2: climb, 3: descent; [m/s], -1 no change; throttle
        Command(SPEED, "change speed", "never", (1, 2, 3)),
    )
}

NOT_FLOWN = {
    31: "loiter to altitude",
    82: "spline waypoint",
    84: "VTOL take-off",
    85: "VTOL landing",
    92: "guided enable",
    93: "delay",
    94: "payload place",
    112: "delay",
    113: "change altitude",
    114: "delay until a distance",
    115: "turn",
    176: "set mode",
    179: "set home",
    183: "set servo",
    189: "start of a landing",
    195: "region of interest",
    197: "no region of interest",
    201: "region of interest",
    203: "camera control",
    205: "gimbal",
    206: "camera trigger by distance",
    211: "gripper",
    530: "camera mode",
    1000: "gimbal",
    2000: "take pictures",
    2001: "stop pictures",
    2500: "start video",
    2501: "stop video",
    3000: "VTOL transition",
}
"""Some that are not, so that a message can name them."""

GLOBAL, MISSION, RELATIVE = 0, 2, 3
FRAMES = {GLOBAL: "above the sea", MISSION: "no place", RELATIVE: "above home"}
"""Of an item's place (MAV_FRAME)."""
FRAMES_NOT_FLOWN = {
    1: "local north, east, down",
    4: "local east, north, up",
    5: "above the sea, by whole numbers",
    6: "above home, by whole numbers",
    10: "above the terrain",
    11: "above the terrain, by whole numbers",
}


def command_words(number: int) -> str:
    """Return a command's number with its name, if it is known."""
    if number in COMMANDS:
        return f"{number} ({COMMANDS[number].name})"
    name = NOT_FLOWN.get(number)
    return f"{number} ({name})" if name else f"{number}"
