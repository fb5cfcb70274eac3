"""Names, rates, schedules and buffers: what a server keeps, and what it refuses."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st

from jblast.errors import InputError
from jblast.scene import Charge
from jblast.world.server import (
    BlastSchedule,
    BufferFull,
    PacketBuffer,
    Registry,
    ScaledRealTime,
    checked_entity,
    checked_motion,
    packet_times,
)
from jblast.world.server.registry import (
    NameTaken,
    NotRegistered,
    WorldFull,
)
from tests.world.server.served import HERE, world

ONE = checked_entity("one", ["flash"], position_m=HERE)


@given(st.lists(st.integers(0, 5), max_size=30), st.integers(1, 7))
def test_a_buffer_gives_back_in_order_and_says_when_it_is_full(counts, capacity):
    buffer, written, read = PacketBuffer(capacity), 0, []
    for count in counts:
        for _ in range(count):
            if buffer.waiting == capacity:
                with pytest.raises(BufferFull):
                    buffer.write(-1)
                break
            buffer.write(written)
            written += 1
        read += list(buffer.read()) if count % 2 else []
    read += list(buffer.read())
    assert read == list(range(written))


@given(st.sampled_from([30.0, 50.0, 99.9, 100.0, 1000.0]), st.integers(0, 10**7))
def test_every_sample_belongs_to_one_packet(packets_hz, number):
    times = packet_times(packets_hz)
    for rate in (100.0, 44_100.0, 48_000.0, 11_025.0):
        first, last = times.samples(number, rate)
        assert times.samples(number + 1, rate)[0] == last
        start = Fraction(number) / times.rate
        assert Fraction(first) / Fraction(str(rate)) >= start
        assert Fraction(first - 1) / Fraction(str(rate)) < start


def test_packets_of_hours_begin_at_whole_numbers_of_them():
    times = packet_times(100.0)
    assert times.start_s(360_000_001) == 3600000.01
    assert times.at(3600000.01 + 1e-9) == 360_000_002


def test_real_time_goes_by_its_clock_once_it_has_begun():
    readings = iter([10.0, 13.0, 13.0, 13.0])
    clock = ScaledRealTime(2.0, lambda: next(readings))
    assert clock.world_s() == 0.0
    clock.begin()
    clock.begin()
    assert clock.world_s() == 6.0
    assert clock.wait_s(8.0) == 1.0
    assert clock.wait_s(1.0) == 0.0


def test_a_name_is_taken_until_its_entity_leaves():
    entities = Registry()
    ticket = entities.register(ONE).ticket
    assert entities.of("one", ticket) is ONE
    with pytest.raises(NameTaken, match="'one': expected another name"):
        entities.register(ONE)
    with pytest.raises(NotRegistered, match="another ticket"):
        entities.of("one", "0")
    entities.drop("one", "peer", "went away")
    with pytest.raises(NotRegistered, match="no such"):
        entities.of("one", ticket)
    assert entities.register(ONE).ticket != ticket
    assert [gone.why for gone in entities.dropped] == ["went away"]


def test_no_more_register_than_fit():
    entities = Registry(most=1)
    entities.register(ONE)
    with pytest.raises(WorldFull, match="at most 1 entities"):
        entities.register(ONE._replace(name="two"))


def test_blasts_are_told_once_within_the_lead():
    schedule = BlastSchedule(world(), 0.5)
    times = [float(charge.time_s) for charge in schedule.charges]
    told = [
        (now, charge.name)
        for now in np.arange(0, 2, 0.01)
        for charge in schedule.announced(now - (0.01 if now else 60.0), now)
    ]
    assert [name for _, name in told] == [charge.name for charge in schedule.charges]
    ahead = [time - now for time, (now, _) in zip(times, told, strict=True)]
    # in the first of packets of 0.01 s from which it is no farther ahead than the lead
    assert all(one + 1e-12 >= 0.5 - 0.01 and one <= 0.5 + 1e-12 for one in ahead[1:])


def test_a_blast_that_is_announced_takes_its_place_in_time():
    schedule = BlastSchedule(world(), 0.5)
    schedule.announce(Charge(1.0, (0.0, 0.0, 0.0), 0.7, name="more"), 0.1)
    times = [float(charge.time_s) for charge in schedule.charges]
    assert times == sorted(times)
    assert "more" in {charge.name for charge in schedule.announced(0.1, 0.25)}


ANNOUNCED = {
    "too soon": (Charge(1.0, time_s=0.5, name="a"), "time_s: expected one after 0.6 s"),
    "never": (Charge(1.0, time_s=math.inf, name="a"), "time_s: expected"),
    "another's name": (Charge(1.0, time_s=9.0, name="1"), "expected a new name"),
    "no name": (Charge(1.0, time_s=9.0), "name: expected a name"),
    "an absurd mass": (
        Charge(1e30, time_s=9.0, name="a"),
        r"mass_kg: expected 1e-06 to 1e\+07 kg, got 1e\+30",
    ),
    "nowhere": (Charge(1.0, (1e300, 0, 0), 9.0, name="a"), "position_m: expected coor"),
    "an entity's place": (
        Charge(1.0, tuple(HERE), 9.0, name="a"),
        r"more than 0\.053 m .* got 0 m from 'one'",
    ),
    "beside it": (
        Charge(1000.0, (30.0, 2.5, 1.5), 9.0, name="a"),
        r"more than 0\.53 m .* got 0\.5 m from 'one'",
    ),
    "a path's midst": (
        Charge(1.0, (50.0, 2.0, 1.5), 9.0, name="a"),
        "got 0 m from 'moves'",
    ),
}
MOVES = checked_entity(
    "moves", ["flash"], path=([0.0, 1.0], [[40.0, 2.0, 1.5], [60.0, 2.0, 1.5]])
)


@pytest.mark.parametrize("name", ANNOUNCED)
def test_what_cannot_be_announced_is_refused(name):
    charge, message = ANNOUNCED[name]
    with pytest.raises(InputError, match=message):
        BlastSchedule(world(), 0.5).announce(charge, 0.1, [ONE, MOVES])


ENTITIES = {
    "no name": (("", ["flash"]), {}, "name: expected 1 to 64"),
    "a long name": (("a" * 65, ["flash"]), {}, "name: expected 1 to 64"),
    "a control character": (("a\n", ["flash"]), {}, "printable"),
    "no sense": (("a", []), {}, "senses: expected some of"),
    "an unknown sense": (("a", ["sond"]), {}, "did you mean sound"),
    "no place": (("a", ["flash"]), {"position_m": None}, "got neither"),
    "both": (("a", ["flash"]), {"path": ([0.0], [HERE])}, "got both"),
    "underground": (("a", ["flash"]), {"position_m": [0, 0, -1]}, "up = -1 m"),
    "NaN": (("a", ["flash"]), {"position_m": [0, 0, math.nan]}, "3 finite numbers"),
    "a rate too high": (("a", ["sound"]), {"samples_hz": 1e6}, "100 to 192,000"),
    "a rate that is none": (("a", ["sound"]), {"samples_hz": math.nan}, "samples_hz"),
    "no vehicle": (("a", ["force"]), {}, "vehicle: expected one of"),
    "an unknown one": (("a", ["force"]), {"vehicle": "iri"}, "did you mean iris"),
    "falling times": (
        ("a", ["flash"]),
        {"position_m": None, "path": ([1.0, 0.0], [HERE, HERE])},
        "expected ascending times, got 0 s after 1 s",
    ),
    "half a path": (
        ("a", ["flash"]),
        {"position_m": None, "path": ([1.0, 2.0], [HERE])},
        "got 2 and 1",
    ),
}


@pytest.mark.parametrize("name", ENTITIES)
def test_who_cannot_take_part_is_refused(name):
    words, options, message = ENTITIES[name]
    with pytest.raises(InputError, match=message):
        checked_entity(*words, **({"position_m": HERE} | options))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (((math.nan), HERE), "time_s: expected a finite number"),
        ((0.0, [0, 0]), "position_m: expected 3"),
        ((0.0, HERE, [math.inf, 0, 0]), "velocity_m_s: expected 3 finite"),
        ((0.0, HERE, HERE, [0, 0, 0, 0]), "quaternion: expected a positive length"),
    ],
)
def test_a_motion_that_is_no_motion_is_refused(given, message):
    with pytest.raises(InputError, match=message):
        checked_motion(*given)


@pytest.mark.parametrize("rate", [0.0, 0.5, 1001.0, math.nan, math.inf])
def test_rates_of_packets_have_a_range(rate):
    with pytest.raises(InputError, match="packets_hz: expected 1 to 1000"):
        packet_times(rate)
