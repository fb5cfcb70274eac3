"""The mission protocol, message by message."""

from typing import Any

import pytest

from jblast.autopilot.mavlink import message
from jblast.autopilot.protocols import Missions, item_fields
from jblast.missions import Plan, mission_of
from jblast.missions.plan import checked_item
from jblast.scene import Place
from tests.tools.mock_autopilot import received

HOME = Place(47.0, 8.0, 500.0)
TAKEOFF = checked_item("", 0, 22, 3, [0, 0, 0, None, 47.0, 8.0, 10.0])
WAYPOINT = checked_item("", 1, 16, 3, [2, 1, 0, None, 47.001, 8.001, 12.5])
JUMP = checked_item("", 2, 177, 2, [1, 2, 0, 0, 0, 0, 0])
ITEMS = (TAKEOFF, WAYPOINT, JUMP)


class Ground:
    """A ground station, and a vehicle with a mission that it speaks to."""

    def __init__(self):
        self.texts: list[str] = []
        check = lambda plan: mission_of(plan, place=HOME, may_hover_on=True)  # noqa: E731
        self.missions = Missions(Plan(ITEMS), HOME, check, self.texts.append)

    def send(self, name: str, **values) -> Any:
        """Send a message; return its answer."""
        sent = self.missions.answer(received(message(name, **values), 255, 190))
        return sent if sent is None else received(sent)

    def upload(self, *fields: dict[str, Any]) -> Any:
        """Upload items; return the last answer."""
        last = self.send("MISSION_COUNT", count=len(fields))
        while last.get_type() == "MISSION_REQUEST_INT":
            last = self.send("MISSION_ITEM_INT", **fields[last.seq])
        return last


ANSWERS = {
    "an item without a request": (
        ("MISSION_ITEM_INT", item_fields(WAYPOINT, 1)),
        ("MISSION_ACK", {"type": 13, "target_system": 255, "target_component": 190}),
    ),
    "the number of fences": (
        ("MISSION_REQUEST_LIST", {"mission_type": 1}),
        ("MISSION_COUNT", {"count": 0, "mission_type": 1}),
    ),
    "an upload of fences": (
        ("MISSION_COUNT", {"count": 4, "mission_type": 1}),
        ("MISSION_ACK", {"type": 3, "mission_type": 1}),
    ),
    "an item beyond the last": (
        ("MISSION_REQUEST_INT", {"seq": 3}),
        ("MISSION_ACK", {"type": 13}),
    ),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_a_message_has_the_answer_of_the_protocol(name):
    (sent, fields), (kind, expected) = ANSWERS[name]
    ground = Ground()
    found = ground.send(sent, **fields)
    assert found.get_type() == kind
    assert {key: getattr(found, key) for key in expected} == expected
    assert ground.missions.items == ITEMS


def test_an_item_out_of_order_is_passed_over_and_the_right_one_asked_for():
    ground = Ground()
    ground.send("MISSION_COUNT", count=3)
    again = ground.send("MISSION_ITEM_INT", **item_fields(WAYPOINT, 1))
    assert (again.get_type(), again.seq) == ("MISSION_REQUEST_INT", 0)


def jump(goal: int) -> dict[str, Any]:
    return item_fields(checked_item("", 1, 177, 2, [goal, 1, 0, 0, 0, 0, 0]), 1)


INVALID = {
    "got 82": [{"command": 82, "frame": 3}],
    "expected a take-off": [item_fields(WAYPOINT, 0)],
    "the number of an item, 0 to 1, got 9": [item_fields(TAKEOFF, 0), jump(9)],
    "the number of an item, 0 to 1, got -1": [item_fields(TAKEOFF, 0), jump(-1)],
}


@pytest.mark.parametrize("words", INVALID)
def test_an_invalid_mission_is_rejected_with_the_reason_and_the_old_one_stays(words):
    ground = Ground()
    assert ground.upload(*INVALID[words]).type == 5
    assert words in ground.texts[0]
    assert ground.missions.items == ITEMS


def test_ignored_commands_are_reported_and_come_back_with_the_mission():
    ground = Ground()
    servo = checked_item("", 2, 183, 2, [9, 1500, 0, 0, 7, 8, 0])
    region = checked_item("", 3, 201, 3, [0, 0, 0, 0, 47.001, 8.002, 3])
    items = (TAKEOFF, WAYPOINT, servo, region)
    assert ground.upload(*(item_fields(x, n) for n, x in enumerate(items))).type == 0
    assert ground.texts == [
        "ignored in uploaded mission: command 183 (1 of 4 items); command 201 "
        "(1 of 4 items)"
    ]
    assert ground.missions.items == items
    assert ground.missions.plan is not None
    assert ground.missions.plan.home == HOME


def test_a_mission_is_cleared():
    ground = Ground()
    assert ground.send("MISSION_CLEAR_ALL").type == 0
    assert ground.missions.plan is None
