"""The mission protocol, message by message."""

from typing import Any

import pytest

from jblast.autopilot.mavlink import message
from jblast.autopilot.protocols import (
    Missions,
    item_fields,
    item_of,
)
from jblast.errors import InputError
from jblast.missions import Plan, mission_of
from jblast.missions.plan import checked_item
from jblast.scene import Place
from tests.tools.mock_autopilot import received

HOME = Place(47.0, 8.0, 500.0)
ITEMS = [
    checked_item("", 0, 22, 3, [0, 0, 0, None, 47.0, 8.0, 10.0]),
    checked_item("", 1, 16, 3, [2, 1, 0, None, 47.001, 8.001, 12.5]),
    checked_item("", 2, 177, 2, [1, 2, 0, 0, 0, 0, 0]),
]


class Ground:
    """A ground station, and the vehicle that it speaks to."""

    def __init__(self, plan=None, check=lambda plan: None):
        self.said: list[str] = []
        self.missions = Missions(plan, HOME, check, self.said.append)

    def tell(self, name: str, **values) -> list[Any]:
        asked = received(message(name, **values), 255, 190)
        sent = self.missions.answer(asked)
        return [] if sent is None else [received(sent)]

    def upload(self, items=ITEMS) -> list[Any]:
        answers = self.tell("MISSION_COUNT", count=len(items))
        while answers and answers[0].get_type() == "MISSION_REQUEST_INT":
            n = answers[0].seq
            answers = self.tell("MISSION_ITEM_INT", **item_fields(items[n], n))
        return answers


def test_what_is_uploaded_is_downloaded_again():
    ground = Ground()
    (ack,) = ground.upload()
    assert (ack.get_type(), ack.type) == ("MISSION_ACK", 0)
    assert (ack.target_system, ack.target_component) == (255, 190)
    assert ground.missions.plan is not None
    assert ground.missions.plan.home == HOME
    (count,) = ground.tell("MISSION_REQUEST_LIST")
    assert count.count == 3
    back = [item_of(ground.tell("MISSION_REQUEST_INT", seq=n)[0]) for n in range(3)]
    assert back == ITEMS


def test_an_item_out_of_order_is_passed_over_and_the_right_one_asked_for():
    ground = Ground()
    ground.tell("MISSION_COUNT", count=3)
    (again,) = ground.tell("MISSION_ITEM_INT", **item_fields(ITEMS[1], 1))
    assert (again.get_type(), again.seq) == ("MISSION_REQUEST_INT", 0)


def test_an_item_that_nobody_asked_for_is_refused():
    ground = Ground()
    (ack,) = ground.tell("MISSION_ITEM_INT", **item_fields(ITEMS[1], 1))
    assert (ack.get_type(), ack.type) == ("MISSION_ACK", 13)


def test_a_mission_that_cannot_be_flown_is_refused_and_the_old_one_kept():
    def check(plan):
        raise InputError("item 1: too far")

    ground = Ground(plan=Plan((ITEMS[0],)), check=check)
    (ack,) = ground.upload()
    assert ack.type == 5
    assert ground.said == ["item 1: too far"]
    assert ground.missions.plan == Plan((ITEMS[0],))


def test_a_command_that_is_not_flown_is_refused_by_name():
    ground = Ground()
    ground.tell("MISSION_COUNT", count=1)
    (ack,) = ground.tell("MISSION_ITEM_INT", command=82, frame=3)
    assert ack.type == 5
    assert "got 82" in ground.said[0]


def test_ignored_commands_are_reported_and_come_back_with_the_mission():
    ground = Ground()
    servo = checked_item("", 3, 183, 2, [9, 1500, 0, 0, 7, 8, 0])
    region = checked_item("", 4, 201, 3, [0, 0, 0, 0, 47.001, 8.002, 3])
    (ack,) = ground.upload([*ITEMS, servo, region])
    assert ack.type == 0
    assert ground.said == [
        "ignored in uploaded mission: command 183 (1 of 5 items); "
        "command 201 (1 of 5 items)"
    ]
    assert ground.missions.items[3:] == (servo, region)


@pytest.mark.parametrize("goal", [9, -1])
def test_a_jump_to_no_item_of_the_mission_is_rejected(goal):
    ground = Ground(check=lambda plan: mission_of(plan, place=HOME))
    jump = checked_item("", 1, 177, 2, [goal, 1, 0, 0, 0, 0, 0])
    (ack,) = ground.upload([ITEMS[1], jump])
    assert ack.type == 5
    assert f"the number of an item, 0 to 1, got {goal}" in ground.said[0]


def test_fences_are_none_and_none_are_taken():
    ground = Ground(plan=Plan(tuple(ITEMS)))
    (count,) = ground.tell("MISSION_REQUEST_LIST", mission_type=1)
    assert (count.count, count.mission_type) == (0, 1)
    (ack,) = ground.tell("MISSION_COUNT", mission_type=1, count=4)
    assert ack.type == 3
    assert len(ground.missions.items) == 3


def test_a_mission_is_cleared():
    ground = Ground(plan=Plan(tuple(ITEMS)))
    (ack,) = ground.tell("MISSION_CLEAR_ALL")
    assert (ack.type, ground.missions.plan) == (0, None)
    (ack,) = ground.tell("MISSION_REQUEST_INT", seq=0)
    assert ack.type == 13
