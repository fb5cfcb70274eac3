"""Which blasts there will be: drawn, given by the scene, or announced meanwhile."""

import bisect
import math

from jblast.errors import InputError, argument, shown
from jblast.scene import Charge
from jblast.world.drawn import DrawnWorld

PAST_S = 60.0
"""How long after it happened a blast is told to one who joins: its wave may be on its
way for 20 km."""
MOST_ANNOUNCED = 10_000
"""Blasts that are announced beside those of the scene, at most."""


class BlastSchedule:
    """The blasts of a world by time; more may be announced ahead of time.

    Attributes:
        lead_s: How long before it happens each entity is told of a blast [s].
    """

    def __init__(self, world: DrawnWorld, lead_s: float):
        """Begin with what was drawn and what the scene gives.

        Args:
            world: The world.
            lead_s: How long ahead blasts are told [s].

        Raises:
            InputError: The lead is negative or not finite.
        """
        if not 0 <= lead_s < math.inf:
            raise InputError(
                f"{argument('lead_s')}: expected 0 s or more, got {lead_s:g} s"
            )
        self.lead_s = lead_s
        self._charges = list(world.charges)
        self._times = [float(charge.time_s) for charge in self._charges]
        self._names = {charge.name for charge in self._charges}
        self._announced = 0

    @property
    def charges(self) -> tuple[Charge, ...]:
        """All of them, in order of time."""
        return tuple(self._charges)

    def announced(self, after_s: float, until_s: float) -> tuple[Charge, ...]:
        """Return the blasts that are told of after a time and until another [s]."""
        first = bisect.bisect_right(self._times, after_s + self.lead_s)
        last = bisect.bisect_right(self._times, until_s + self.lead_s)
        return tuple(self._charges[first:last])

    def announce(self, charge: Charge, now_s: float) -> None:
        """Add a blast that is yet to come.

        Args:
            charge: Its name is new, its time is the lead after now, or later.
            now_s: How far the foremost entity has come [s].

        Raises:
            InputError: It comes too soon, its name is taken or empty, or there are too
                many.
        """
        where = f"blast {shown(charge.name)}"
        when = float(charge.time_s)
        if not charge.name:
            raise InputError("blast name: expected one, got none")
        if charge.name in self._names:
            raise InputError(f"{where}: expected a new name, got that of another blast")
        if not now_s + self.lead_s < when < math.inf:
            raise InputError(
                f"{where} time_s: expected one after {now_s + self.lead_s:g} s, as it "
                f"is {now_s:g} s and blasts are told {self.lead_s:g} s ahead; got "
                f"{when:g}"
            )
        if self._announced >= MOST_ANNOUNCED:
            raise InputError(
                f"{where}: expected at most {MOST_ANNOUNCED:,} announced blasts, got "
                "more"
            )
        place = bisect.bisect_right(self._times, when)
        self._times.insert(place, when)
        self._charges.insert(place, charge)
        self._names.add(charge.name)
        self._announced += 1
