"""A ring gives back what was written, in order, and never more or less."""

from collections import deque

import numpy as np
import pytest
from hypothesis import given, strategies as st

from jblast.sensors.samples import Ring


@given(st.integers(1, 20), st.lists(st.integers(-20, 20), max_size=40))
def test_a_ring_is_a_queue_of_limited_length(capacity, deeds):
    ring, queue, made = Ring(capacity), deque(), 0
    for size in deeds:
        if size < 0:
            if -size > len(queue):
                with pytest.raises(ValueError, match="waiting samples"):
                    ring.read(-size)
                continue
            assert ring.peek(-size).tolist() == [queue[i] for i in range(-size)]
            assert ring.read(-size).tolist() == [queue.popleft() for _ in range(-size)]
        elif len(queue) + size > capacity:
            with pytest.raises(ValueError, match="the free space"):
                ring.write(np.zeros(size))
        else:
            samples = np.arange(made, made + size, dtype=float)
            ring.write(samples)
            queue.extend(samples)
            made += size
        assert ring.waiting == len(queue)
        assert ring.capacity == capacity
