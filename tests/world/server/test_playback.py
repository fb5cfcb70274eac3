"""What comes to an entity is what the laws say, in the packet that it belongs to."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Instrument, Sensor
from jblast.sensors import Track, recording
from jblast.world import arrivals_of
from jblast.world.server import (
    BlastSchedule,
    checked_entity,
    checked_motion,
    packets_of,
)
from jblast.world.server.playback import standpoint
from tests.world.server.served import (
    ENDS_S,
    HERE,
    LEAD_S,
    playback,
    stager,
    step,
    world,
)

ALL = ["flash", "ground", "pressure", "sound", "force"]
EVERYTHING = checked_entity("e", ALL, position_m=HERE, vehicle="hummingbird")
RATE = 8000.0


@pytest.fixture(scope="module")
def packets():
    return list(packets_of(playback(EVERYTHING), stager()))


def test_packets_come_one_after_another_to_the_end(packets):
    assert [packet.number for packet in packets] == list(range(200))
    assert [packet.time_s for packet in packets] == [n / 100 for n in range(200)]
    assert [packet.last for packet in packets] == [False] * 199 + [True]


def test_blasts_are_told_once_and_ahead_of_time(packets):
    told = [(packet.time_s, one) for packet in packets for one in packet.announcements]
    assert [one.charge.name for _, one in told] == list(world().shots)
    for time, one in told:
        ahead = float(one.charge.time_s) - time
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
        whole[part.first : part.first + len(part.samples)] = part.samples
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


def test_forces_are_those_that_were_announced(packets):
    total = np.zeros((round(ENDS_S * 2000), 6))
    played = np.zeros_like(total)
    for packet in packets:
        for one in packet.announcements:
            rows = np.concatenate([one.force.force_n, one.force.moment_nm], axis=1)
            total[one.force.first : one.force.first + len(rows)] += rows
        part = packet.force
        played[part.first : part.first + len(part.samples)] = part.samples
    assert np.abs(total).max() > 1.0
    np.testing.assert_array_equal(played, total)


def test_one_who_comes_late_hears_what_is_under_way_and_no_more():
    late = playback(EVERYTHING, first=120)
    packets = list(packets_of(late, stager()))
    assert packets[0].number == 120
    told = {one.charge.name for packet in packets for one in packet.announcements}
    arrivals = {
        charge.name: stager().stage(EVERYTHING, charge).last_s()
        for charge in world().charges
    }
    assert told == {name for name, last in arrivals.items() if last >= 1.2}


@pytest.mark.slow
def test_a_blast_added_after_its_lead_comes_in_the_next_packet():
    """Whoever is past it receives what has not arrived yet, as one who joins."""
    schedule = BlastSchedule(world(), LEAD_S)
    flash = EVERYTHING._replace(senses=("flash", "pressure"))
    played = playback(flash, schedule=schedule)
    for _ in range(100):
        step(played)
    wanted = played.wanted()
    for name, time_s, up in (("soon", 1.2, 0.0), ("past", 0.98, 2.0)):
        charge = Charge(3.0, (5.0, 5.0, up), time_s, name=name)
        schedule.announce(charge, 0.0)
    # one was added while the packet before was staged
    played.next([stager().stage(*one) for one in wanted])
    first, *rest = packets_of(played, stager())
    assert {"soon", "past"} <= {one.charge.name for one in first.announcements}
    told = [one.charge.name for p in rest for one in p.announcements]
    assert not {"soon", "past"} & set(told)
    seen = {(one.shot, one.sense) for p in [first, *rest] for one in p.perceived}
    assert ("soon", "flash") in seen
    assert ("past", "pressure") in seen
    assert ("past", "flash") not in seen


@pytest.mark.slow
def test_one_who_moves_is_told_anew_where_it_meets_the_wave():
    """It reports a straight flight, so its last word is that of the path known ahead;
    1e-9 s, as the two tracks are counted from other knots."""
    speed = np.array([25.0, 0.0, 0.0])
    start = np.array([60.0, 0.0, 5.0])
    reports = playback(checked_entity("r", ["pressure"], position_m=start.tolist()))
    path = [0.0, 2.0], [start, start + 2.0 * speed]
    known = playback(checked_entity("k", ["pressure"], path=path))
    heard, revisions, ahead = {}, 0, []
    while not (packet := step(reports)).last:
        for one in packet.announcements:
            revisions += one.revision > 0
            if one.revision:
                ahead.append(one.arrivals.air_s - packet.time_s)
        heard |= {one.shot: one.time_s for one in packet.perceived}
        now = reports.time_s
        reports.report(checked_motion(now, start + now * speed, speed))
    expected = {}
    while not (packet := step(known)).last:
        expected |= {one.shot: one.time_s for one in packet.perceived}
    assert revisions >= len(world().shots)
    assert min(ahead) > 0.0
    assert set(heard) == set(expected) == set(world().shots)
    for shot, time in expected.items():
        assert heard[shot] == pytest.approx(time, abs=1e-9)


def test_what_was_told_is_let_go_of_when_it_is_over():
    played = playback(EVERYTHING._replace(senses=("flash", "pressure")), until_s=9.0)
    waiting = [(step(played), played.waiting)[1] for _ in range(900)]
    assert max(waiting) > 0
    assert waiting[-1] == 0


def test_at_the_charge_there_is_no_answer():
    charge = world().charges[0]
    place = [float(x) for x in charge.position_m]
    here = checked_entity("e", ["pressure"], position_m=place)
    with pytest.raises(InputError, match="away from it"):
        stager().stage(here, charge)


def test_a_track_that_lands_ends_on_the_ground():
    falls = checked_motion(1.0, [0.0, 0.0, 3.0], [2.0, 0.0, -1.5])
    track = standpoint(EVERYTHING, falls)
    assert isinstance(track, Track)
    np.testing.assert_allclose(track.at(jnp.array(60.0)), [4.0, 0.0, 0.0], atol=1e-12)
