"""Gauges are set up by one program, whenever their records begin."""

from typing import Any

import jax

from jblast.scene import Instrument, Sensor
from jblast.sensors import gauge as gauge_module


def test_another_start_is_no_other_program():
    gauge = Sensor("a", (1.0, 0.0, 1.0), kind="pressure", instrument=Instrument())
    for start in (0.0, 0.25, 1.5):
        found, _ = gauge_module.mounted(gauge, jax.random.key(0), start)
        assert float(found.begin) == start
    program: Any = gauge_module._mounted
    sizes = program._cached._cache_size()
    gauge_module.mounted(gauge, jax.random.key(0), 2.75)
    assert program._cached._cache_size() == sizes
