"""The peak of a record as a row of a log: reading or lower bound."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.observations import read, write
from jblast.scene import Instrument, Sensor
from jblast.sensors.instrument import peak_log, peak_reading, quantised, saturated

SCALE = 200.0
CLIP = Instrument(rate=1e3, full_scale=SCALE)
SOFT = Instrument(rate=1e3, full_scale=SCALE, saturation="compress")
CODED = Instrument(rate=1e3, full_scale=SCALE, bits=16)
SOFT_CODED = Instrument(rate=1e3, full_scale=SCALE, bits=16, saturation="compress")


def written(peak, instrument):
    """What an instrument writes of a pulse of a peak, with suction half as large."""
    pulse = jnp.array([0.0, 0.3, 1.0, 0.6, -0.5, 0.0]) * peak
    return quantised(saturated(pulse, instrument), instrument)


@pytest.mark.parametrize("instrument", [CLIP, SOFT, CODED, SOFT_CODED])
@pytest.mark.parametrize("peak", [1.0, 60.0, 190.0])
def test_a_peak_within_the_full_scale_is_read(instrument, peak):
    found = peak_reading(written(peak, instrument), instrument)
    assert not found.lower_bound
    # half a step of 16 bits, which the soft compression's slope of 0.5 at most doubles
    assert found.value == pytest.approx(peak, abs=SCALE / 2**15)
    assert found.sigma == pytest.approx(0.05 * peak, rel=0.01)


@pytest.mark.parametrize("instrument", [CLIP, SOFT, CODED, SOFT_CODED])
@pytest.mark.parametrize("peak", [230.0, 5e3, 1e9])
def test_a_peak_beyond_it_is_a_lower_bound_of_the_truth(instrument, peak):
    found = peak_reading(written(peak, instrument), instrument)
    assert found.lower_bound
    assert found.value == pytest.approx(SCALE, abs=SCALE / 2**14)
    assert found.value <= peak


def test_clipped_suction_is_no_bound_of_the_peak():
    samples = jnp.array([0.0, 50.0, -SCALE, -SCALE, 0.0])
    assert not peak_reading(samples, CLIP).lower_bound


def test_many_records_are_read_at_once_and_one_without_a_scale_never_clips():
    samples = jnp.stack([written(peak, CLIP) for peak in (10.0, 1e3)])
    found = jax.jit(peak_reading)(samples, CLIP)
    np.testing.assert_array_equal(found.lower_bound, [False, True])
    free = Instrument(rate=1e3)
    assert not peak_reading(written(1e9, free), free).lower_bound


def test_peaks_become_rows_that_a_log_keeps(tmp_path):
    sensors = [
        Sensor(name, jnp.array([r, 0.0, 1.5])) for name, r in (("a", 9.0), ("b", 40.0))
    ]
    readings = [peak_reading(written(p, CLIP), CLIP) for p in (1e4, 120.0)]
    write(tmp_path / "log.csv", peak_log(sensors, readings))
    assert (
        "a,peak_overpressure_pa,>200.0,10.0,9.0" in (tmp_path / "log.csv").read_text()
    )
    again = read(tmp_path / "log.csv")
    np.testing.assert_array_equal(again.bounds(), [True, False])
    assert peak_log(sensors[1:], readings[1:]).lower_bound is None
