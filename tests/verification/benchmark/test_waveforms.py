import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from jblast.errors import InputError
from jblast.verification.benchmark.chart import on_pareto_front
from jblast.verification.benchmark.laws import (
    POSITIVE,
    WHOLE,
    PulseParameters,
    Waveform,
    form_error,
    gauge_march,
    reference_uncertainty,
    waveform_points,
    waveforms,
    with_suction,
)
from jblast.waves.laws.point_source import log_overpressure_ratio
from jblast.waves.waveform import friedlander_impulse

PLACE = 2.0
CELLS = 40


def wave_of(decay, suction=0.2, ripple=0.0):
    """Friedlander's pulse of unit peak and duration, then a cubic twice as long."""
    pulse = PulseParameters(
        *(
            jnp.asarray(value)
            for value in (
                1.0,
                1.0,
                float(friedlander_impulse(1.0, 1.0, decay)),
                suction,
                9.0 / 16.0 * suction * 2.0,
            )
        )
    )
    time = np.linspace(0.0, 3.0, 6001)
    pressure = np.asarray(with_suction(jnp.asarray(time), pulse))
    pressure = pressure + ripple * np.sin(np.pi * time)
    return Waveform(PchipInterpolator(time, pressure), pulse, 3.0)


@pytest.fixture(scope="module")
def run():
    return gauge_march(CELLS, (PLACE,), 4.0)


def test_a_form_is_exact_where_the_wave_is_of_that_form():
    wave = wave_of(2.0)
    # cubics between nodes 5e-4 apart, of a curve that bends by 10
    assert form_error(POSITIVE["Friedlander, b of impulse"], wave, 1.0) < 1e-6
    assert form_error(WHOLE["b of impulse, then cubic"], wave, 3.0) < 1e-6
    triangle = wave_of(0.0)
    assert form_error(POSITIVE["triangle"], triangle, 1.0) < 1e-6
    assert form_error(POSITIVE["Friedlander, b = 1"], wave_of(1.0), 1.0) < 1e-6


def test_the_error_of_a_triangle_is_the_rms_distance_in_peaks():
    x = np.linspace(0.0, 1.0, 256)
    expected = np.sqrt(np.mean(((1.0 - x) * (1.0 - np.exp(-2.0 * x))) ** 2))
    assert form_error(POSITIVE["triangle"], wave_of(2.0), 1.0) == pytest.approx(
        expected, rel=1e-5
    )


def test_what_comes_after_the_positive_phase_counts_in_both_phases_alone():
    wave = wave_of(2.0)
    cut, cubic = (WHOLE[f"b of impulse, then {what}"] for what in ("nothing", "cubic"))
    assert form_error(cut, wave, 1.0) == pytest.approx(
        form_error(cubic, wave, 1.0), abs=1e-9
    )
    assert form_error(cut, wave, 3.0) > 1e4 * form_error(cubic, wave, 3.0)


def test_own_error_is_that_of_the_finest_of_second_order_runs():
    def wave(ripple):
        return wave_of(1.0, ripple=ripple)

    exact = reference_uncertainty(wave(1.6e-2), wave(4e-3), wave(1e-3), 1.0)
    # the rms of a sine over half a turn, on 256 samples with both ends
    assert exact == pytest.approx(1e-3 / np.sqrt(2.0), rel=0.01)


def test_a_gauge_is_passed_by_the_exact_shock(run):
    (wave,) = waveforms(run, (PLACE,))
    exact = float(jnp.exp(log_overpressure_ratio(jnp.log(PLACE))))
    # 40 cells: 1/4 of the 0.1 % of 100 cells, squared away
    assert float(wave.pulse.peak) == pytest.approx(exact, rel=0.01)
    assert float(wave.pressure(0.0)) == float(wave.pulse.peak)
    assert float(wave.pressure(wave.pulse.duration)) == pytest.approx(0.0, abs=1e-12)
    assert wave.end > 3.0 * float(wave.pulse.duration)
    assert 0.0 < float(wave.pulse.suction) < float(wave.pulse.peak)


def test_a_decay_of_the_impulse_is_nearer_than_a_triangle_and_decay_one(run):
    (wave,) = waveforms(run, (PLACE,))
    errors = {
        name: form_error(form, wave, float(wave.pulse.duration))
        for name, form in POSITIVE.items()
    }
    fitted = errors.pop("Friedlander, b of impulse")
    assert fitted < 0.1 * min(errors.values())
    assert errors["triangle"] > errors["Friedlander, b = 1"]


def test_a_run_that_ends_within_a_phase_is_refused(run):
    early = run.history.clock < 1.3 * PLACE
    history = jax.tree.map(lambda values: values[early], run.history)
    with pytest.raises(InputError, match="past the end of the negative phase"):
        waveforms(dataclasses.replace(run, history=history), (PLACE,))


@pytest.mark.slow
def test_more_cells_are_nearer_to_the_reference_and_cost_more():
    points = waveform_points((PLACE,), 4.0, (40, 80, 160))
    phases = [points[:6], points[6:]]
    assert [len(phase) for phase in phases] == [6, 7]
    for phase in phases:
        coarse, middle, fine = phase[-3:]
        assert coarse.error > 2.0 * middle.error > 2.0 * fine.error > 0.0
        assert [p.is_reference for p in phase] == [False] * (len(phase) - 1) + [True]
        closed = [p for p in phase if "cells" not in p.method]
        assert max(p.cost_s for p in closed) < coarse.cost_s
    front = on_pareto_front(points)
    assert {p.method for p, on in zip(points, front, strict=True) if on} >= {
        "Friedlander, b of impulse",
        "b of impulse, then cubic",
        "160 cells",
    }
