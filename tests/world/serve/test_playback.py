"""What comes to an entity is what the laws say, in the packet that it belongs to."""

from dataclasses import replace
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from jblast.scene import Instrument, Sensor
from jblast.sensors import Track, recording
from jblast.world import arrivals_of
from jblast.world.serve import (
    Entity,
    Knot,
    Motion,
    NewBlast,
    Options,
    Playback,
    ServedWorld,
    packet_times,
    packets_of,
    stage,
)
from jblast.world.serve.staging import standpoint
from tests.world.serve.served import (
    ENDS_S,
    HERE,
    LEAD_S,
    playback,
    served,
    step,
    world,
)

ALL = ["flash", "ground", "pressure", "sound", "force"]
EVERYTHING = Entity("e", ALL, [Knot(HERE)], vehicle="hummingbird")
RATE = 8000.0


@pytest.fixture(scope="module")
def packets():
    return list(packets_of(playback(EVERYTHING)))


def test_blasts_are_told_once_and_ahead_of_time(packets):
    told = [(packet.time_s, one) for packet in packets for one in packet.announcements]
    assert [one.shot for _, one in told] == list(world().shots)
    for time, one in told:
        ahead = one.time_s - time
        assert ahead <= LEAD_S
        assert ahead > LEAD_S - 0.01 or time == 0.0


def test_what_is_perceived_stands_in_its_packet_at_the_times_of_the_laws(packets):
    """The same function of the same numbers; 1e-12 s leaves room for the compiler."""
    scene = world().scene
    sensors = (Sensor("e", HERE),)
    times = arrivals_of(replace(scene, sensors=sensors)).times_s
    words = {
        "flash": "flash_time_s",
        "ground motion": "ground_arrival_s",
        "ground sound": "ground_arrival_s",
        "pressure": "air_arrival_s",
        "sound": "air_arrival_s",
        "force": "air_arrival_s",
    }
    seen = {}
    for packet in packets:
        for one in packet.perceived:
            assert packet.time_s <= one.time_s < packet.time_s + 0.01 + 1e-12
            assert (one.shot, one.sense) not in seen
            seen[one.shot, one.sense] = one.time_s
    for number, charge in enumerate(scene.charges):
        for sense, wave in words.items():
            expected = times[wave][0, number]
            assert seen[charge.name, sense] == pytest.approx(expected, abs=1e-12)


def _played(packets, sense):
    whole = np.zeros(round(ENDS_S * RATE))
    for packet in packets:
        part = getattr(packet, sense)
        whole[part.first : part.first + len(part.values)] = part.values
    return whole


@pytest.mark.parametrize(
    ("sense", "kind"), [("pressure", "pressure"), ("sound", "microphone")]
)
def test_samples_are_those_of_an_instrument_that_adds_nothing(packets, sense, kind):
    """To 1e-9 of the peak: times are counted from the stretch's beginning, not from 0,
    which moves them by 1e-16 s, and a front rises in 1e-5 s; silence is cut at 1e-9 Pa.
    """
    sensor = Sensor("e", HERE, kind=kind, instrument=Instrument(rate=RATE))
    exact = recording(world().scene, sensor, jax.random.key(0)).samples(ENDS_S)
    played = _played(packets, sense)
    assert np.abs(played).max() > 1e3
    np.testing.assert_allclose(played, exact, atol=1e-9 * np.abs(played).max())


def test_a_packet_has_the_samples_of_its_time_only():
    """Samples before the beginning of the clock are in no packet."""
    played = playback(EVERYTHING)
    step(played)
    (live,) = played.live.values()
    rows = live.samples["pressure"][0]._replace(first=-3, values=np.arange(1.0, 200.0))
    again = playback(EVERYTHING)
    again.live["early"] = live._replace(samples={"pressure": (rows,)})
    first, second = again.next([]), again.next([])
    for packet, number in ((first, 0), (second, 80)):
        assert packet.pressure is not None
        assert packet.pressure.first == number
        expected = np.arange(4.0, 84.0) + number
        np.testing.assert_array_equal(packet.pressure.values, expected)


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


def test_one_who_comes_late_hears_what_is_under_way_and_no_more():
    late = playback(EVERYTHING, first=120)
    packets = list(packets_of(late))
    assert packets[0].number == 120
    told = {one.shot for packet in packets for one in packet.announcements}
    arrivals = {
        charge.name: stage(served(), EVERYTHING, charge).announced.ends_s
        for charge in world().charges
    }
    assert told == {name for name, last in arrivals.items() if last >= 1.2}


@pytest.mark.slow
def test_a_blast_added_after_its_lead_comes_in_the_next_packet():
    """Whoever is past it receives what has not arrived yet, as one who joins."""
    own = ServedWorld(world(), Options(lead_s=LEAD_S, ends_s=ENDS_S))
    flash = replace(EVERYTHING, senses=("flash", "pressure"))
    played = Playback(flash, own)
    for _ in range(100):
        step(played)
    wanted = played.wanted()
    for name, time_s, up in (("soon", 1.2, 0.0), ("past", 0.98, 2.0)):
        own.announce(NewBlast(name, time_s, [5.0, 5.0, up], 3.0), 0.0)
    # one was added while the packet before was staged
    played.next([stage(own, flash, one) for one in wanted])
    first, *rest = packets_of(played)
    assert {"soon", "past"} <= {one.shot for one in first.announcements}
    told = [one.shot for p in rest for one in p.announcements]
    assert not {"soon", "past"} & set(told)
    seen = {(one.shot, one.sense) for p in [first, *rest] for one in p.perceived}
    assert ("soon", "flash") in seen
    assert ("past", "pressure") in seen
    assert ("past", "flash") not in seen


def test_what_was_told_is_let_go_of_when_it_is_over():
    entity = replace(EVERYTHING, senses=("flash", "pressure"))
    played = Playback(entity, served(ends_s=9.0))
    waiting = [(step(played), len(played.live))[1] for _ in range(900)]
    assert max(waiting) > 0
    assert waiting[-1] == 0


def test_a_wave_is_perceived_once_however_an_entity_jumps():
    """Towards a charge a wave would have come before: it comes in the next packet."""
    entity = Entity("e", ["ground", "pressure"], [Knot(HERE)])
    played, seen, revisions = playback(entity), [], {}
    for number in range(200):
        if number % 5 == 0:
            east = HERE[0] - 12.0 * (number // 5 % 2)
            played.motion = Motion(number / 100, [east, *HERE[1:]])
        packet = step(played)
        seen += [(one.shot, one.sense) for one in packet.perceived]
        for one in packet.announcements:
            assert one.revision == revisions.get(one.shot, -1) + 1
            revisions[one.shot] = one.revision
    assert min(revisions.values()) > 0
    senses = ("ground motion", "pressure")
    assert sorted(seen) == [
        (s, sense) for s in sorted(world().shots) for sense in senses
    ]


def test_a_track_that_lands_ends_on_the_ground():
    falls = Motion(1.0, [0.0, 0.0, 3.0], [2.0, 0.0, -1.5])
    track = standpoint(EVERYTHING, falls)
    assert isinstance(track, Track)
    np.testing.assert_allclose(track.at(jnp.array(60.0)), [4.0, 0.0, 0.0], atol=1e-12)
