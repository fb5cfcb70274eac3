"""The mission protocol of MAVLink, from the vehicle's side: up, down, away.

mavlink.io/en/services/mission.html: who uploads says how many items there are, and is
asked for them one after another; an item that was not asked for is passed over and the
right one asked for again, as is one that does not come within `RETRY_S`, `RETRIES`
times. A mission that cannot be flown is refused whole, and the one before is kept.
"""

from collections.abc import Callable

from jblast.autopilot.ground_station.items import item_fields, item_of, plan_of
from jblast.autopilot.mavlink.wire import Message, Sender
from jblast.errors import InputError
from jblast.missions.plan.item import Item, Plan
from jblast.scene import Place

RETRY_S, RETRIES = 1.5, 5
"""As the protocol recommends."""
MOST_ITEMS = 1000
ACCEPTED, ERROR, UNSUPPORTED, NO_SPACE, INVALID, SEQUENCE = 0, 1, 3, 4, 5, 13
"""MAV_MISSION_RESULT."""
FLIGHT_PLAN = 0
"""MAV_MISSION_TYPE; fences and rally points are others."""


class Missions:
    """The mission that a vehicle holds.

    Attributes:
        plan: It; None: there is none.

    Args:
        plan: What it holds at first.
        home: Where the vehicle stands.
        check: Refuses a plan that cannot be flown, by an `InputError`.
        say: Is told what the ground station should read.
    """

    def __init__(
        self,
        plan: Plan | None,
        home: Place,
        check: Callable[[Plan], object],
        say: Callable[[str], object],
    ):
        self.plan = plan
        self._home, self._check, self._say = home, check, say
        self._items: list[Item] | None = None
        self._count = self._tries = 0
        self._asked_s = 0.0
        self._from = (0, 0)

    @property
    def items(self) -> tuple[Item, ...]:
        """Of the plan."""
        return () if self.plan is None else self.plan.items

    def answer(self, sender: Sender, message: Message, now_s: float) -> list[bytes]:
        """Return what is answered to a message of the protocol.

        Args:
            sender: Packs it.
            message: That came.
            now_s: On the wall clock.
        """
        said, who = message.values, (message.system, message.component)
        if said.get("mission_type", FLIGHT_PLAN) != FLIGHT_PLAN:
            return self._other(sender, message)
        if message.name == "MISSION_REQUEST_LIST":
            return [_to(sender, who, "MISSION_COUNT", count=len(self.items))]
        if message.name in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            return [self._item(sender, who, said["seq"])]
        if message.name == "MISSION_CLEAR_ALL":
            self.plan, self._items = None, None
            return [_ack(sender, who, ACCEPTED)]
        if message.name == "MISSION_COUNT":
            return self._begin(sender, who, said["count"], now_s)
        if message.name == "MISSION_ITEM_INT" and self._items is not None:
            return self._take(sender, message, now_s)
        if message.name == "MISSION_ITEM_INT":
            self._say("mission item: expected one that was asked for, got another")
            return [_ack(sender, who, SEQUENCE)]
        return []

    def remind(self, sender: Sender, now_s: float) -> list[bytes]:
        """Return the request of an item that did not come; after some, give up."""
        if self._items is None or now_s - self._asked_s < RETRY_S:
            return []
        self._tries += 1
        if self._tries > RETRIES:
            self._say(f"upload: item {len(self._items)} did not come, given up")
            self._items = None
            return [_ack(sender, self._from, ERROR)]
        return [self._ask(sender, now_s)]

    def _begin(
        self, sender: Sender, who: tuple[int, int], count: int, now_s: float
    ) -> list[bytes]:
        if count > MOST_ITEMS:
            self._say(f"upload: expected at most {MOST_ITEMS} items, got {count}")
            return [_ack(sender, who, NO_SPACE)]
        if count == 0:
            self.plan, self._items = None, None
            return [_ack(sender, who, ACCEPTED)]
        self._items, self._count, self._from, self._tries = [], count, who, 0
        return [self._ask(sender, now_s)]

    def _take(self, sender: Sender, message: Message, now_s: float) -> list[bytes]:
        items = self._items
        assert items is not None
        if message.values["seq"] != len(items):
            return [self._ask(sender, now_s)]
        try:
            items.append(item_of(message.values))
            if len(items) < self._count:
                self._tries = 0
                return [self._ask(sender, now_s)]
            plan = plan_of(items, self._home)
            self._check(plan)
        except InputError as error:
            self._say(str(error))
            whole, self._items = len(items) == self._count, None
            return [_ack(sender, self._from, INVALID if whole else UNSUPPORTED)]
        self.plan, self._items = plan, None
        return [_ack(sender, self._from, ACCEPTED)]

    def _ask(self, sender: Sender, now_s: float) -> bytes:
        self._asked_s = now_s
        sequence = len(self._items or [])
        return _to(sender, self._from, "MISSION_REQUEST_INT", seq=sequence)

    def _item(self, sender: Sender, who: tuple[int, int], sequence: int) -> bytes:
        if sequence >= len(self.items):
            return _ack(sender, who, SEQUENCE)
        fields = item_fields(self.items[sequence], sequence)
        return _to(sender, who, "MISSION_ITEM_INT", **fields)

    def _other(self, sender: Sender, message: Message) -> list[bytes]:
        """Answer for fences and rally points: there are none, and none are taken."""
        who, kind = (
            (message.system, message.component),
            message.values["mission_type"],
        )
        if message.name == "MISSION_REQUEST_LIST":
            return [_to(sender, who, "MISSION_COUNT", count=0, mission_type=kind)]
        if message.name in ("MISSION_COUNT", "MISSION_CLEAR_ALL"):
            none = message.values.get("count", 0) == 0
            result = ACCEPTED if none else UNSUPPORTED
            return [_ack(sender, who, result, mission_type=kind)]
        return []


def _to(sender: Sender, who: tuple[int, int], name: str, **fields: object) -> bytes:
    return sender.pack(name, target_system=who[0], target_component=who[1], **fields)


def _ack(
    sender: Sender, who: tuple[int, int], result: int, mission_type: int = FLIGHT_PLAN
) -> bytes:
    return _to(sender, who, "MISSION_ACK", type=result, mission_type=mission_type)
