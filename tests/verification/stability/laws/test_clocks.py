import dataclasses

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import fit
from jblast.observations.clocks import refuse_unresolved
from jblast.scene import Free, Scene, UncertainScene
from jblast.verification.stability.laws import (
    arrival_at,
    clock_failures,
    coarse_from,
)


def test_single_precision_steps_over_a_millisecond_from_16384_s_on():
    assert coarse_from(np.float32, 1e-3) == 16384.0
    assert np.float32(16384.0) + np.float32(0.9e-3) == np.float32(16384.0)
    # and a step below it still tells 1 ms
    assert np.float32(8192.0) + np.float32(1e-3) > np.float32(8192.0)
    assert np.spacing(np.float32(1.7e9)) == 128.0
    single, double = clock_failures()
    assert single.boundary == 16384.0
    assert double.boundary == 2.0**33


@pytest.mark.parametrize(
    ("time", "dtype", "refused"),
    [
        (60.0, np.float32, False),
        (3600.0, np.float32, False),
        (16384.0, np.float32, True),
        (1.7e9, np.float32, True),
        (1.7e9, np.float64, False),
    ],
)
def test_a_time_too_coarse_for_its_sigma_is_refused(time, dtype, refused):
    log = arrival_at(time, 1e-3)
    if refused:
        with pytest.raises(
            InputError, match="expected times counted from near the shot"
        ):
            refuse_unresolved(log, dtype)
    else:
        refuse_unresolved(log, dtype)


def test_rows_without_sigma_and_rows_of_no_clock_are_let_through():
    refuse_unresolved(arrival_at(1.7e9, np.nan), np.float32)
    pressure = dataclasses.replace(
        arrival_at(1.7e9, 1e-3), quantity=("peak_overpressure_pa",)
    )
    refuse_unresolved(pressure, np.float32)


def test_a_fit_refuses_what_even_double_precision_cannot_hold():
    scene = UncertainScene(
        Scene(law=(("air_arrival_s", "kingery_bulmash"),)),
        {"charge_mass_kg": Free(positive=True), "origin_time_s": Free(positive=False)},
    )
    with pytest.raises(
        InputError, match=r"in float64 such times are 2\.38e-07 s apart"
    ):
        fit(arrival_at(1.7e9, 1e-8), scene)
