"""The thesis's packets are the long waveform, whatever is sent and when it blasts."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.sensors.microphone import LoopPackets

DEED = st.tuples(st.booleans(), st.floats(0, 1), st.floats(0, 1))


@settings(max_examples=200)
@given(st.integers(1, 40), st.lists(DEED, max_size=30))
def test_packets_are_the_loop_for_ever_with_each_blast_once_at_its_time(size, deeds):
    rng = np.random.default_rng(size)
    loop = rng.normal(size=size)
    packets = LoopPackets(loop)
    long = np.tile(loop, 2 + 3 * (len(deeds) + 1))
    sent = [np.empty(0)]
    head = 0
    for is_blast, part, share in deeds:
        if is_blast:
            length = round(share * packets.reach)
            at = round(part * (packets.reach - length))
            sound = rng.normal(size=length)
            packets.add_blast(at, sound)
            long[head + at : head + at + length] += sound
        else:
            sent.append(packets.send(round(part * size)))
            head += sent[-1].size
        assert size <= packets.waiting <= 3 * size
    sent.extend(packets.send(size) for _ in range(3))
    waveform = np.concatenate(sent)
    # what overlaps is added in the same order, so to the last bit
    assert np.array_equal(waveform, long[: waveform.size])


def test_a_packet_is_clipped_from_the_head_and_appended_at_the_end():
    packets = LoopPackets(np.arange(10.0))
    assert packets.send(3).tolist() == [0, 1, 2]
    assert packets.waiting == 10
    assert np.concatenate([packets.send(8), packets.send(10)]).tolist() == [
        *(3, 4, 5, 6, 7, 8, 9, 0),
        *(1, 2, 3, 4, 5, 6, 7, 8, 9, 0),
    ]


def test_case_1_a_blast_within_the_loop_leaves_the_length():
    packets = LoopPackets(np.zeros(10))
    packets.add_blast(6, np.ones(4))
    assert packets.waiting == 10
    assert packets.send(10).tolist() == [0] * 6 + [1] * 4
    assert packets.send(10).tolist() == [0] * 10  # and is not recycled


def test_case_2_a_blast_after_the_loop_extends_it_to_a_loop_past_its_end():
    packets = LoopPackets(np.arange(10.0))
    packets.add_blast(9, np.ones(4))
    assert packets.waiting == 9 + 4 + 10
    packets = LoopPackets(np.arange(10.0))
    packets.add_blast(packets.reach - 1, np.ones(1))
    assert packets.waiting == 30
    # at three loops nothing is appended: what waits shrinks, and grows no more
    packets.send(4)
    assert packets.waiting == 26
    packets.send(4)
    assert packets.waiting == 26


def test_what_cannot_be_sent_or_heard_is_refused():
    packets = LoopPackets(np.zeros(10))
    for size in (-1, 11):
        with pytest.raises(ValueError, match=r"0 to 10 samples \(one loop"):
            packets.send(size)
    for at, length in ((-1, 2), (19, 2), (0, 21)):
        with pytest.raises(ValueError, match="within 20 samples of the head"):
            packets.add_blast(at, np.ones(length))
    with pytest.raises(ValueError, match="one or more samples, got none"):
        LoopPackets(np.zeros(0))
