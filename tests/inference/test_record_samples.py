"""Samples of records in fits of more than the mass, and of clipped records."""

import jax
import numpy as np
import pytest

from calibration.cases import LAWS, MASS, RANGES, Recorder, readings, recorded
from jblast.inference import fit
from jblast.observations import read
from jblast.scene import default_scene, freed, with_laws

HEAD = "sensor,quantity,value,sigma,east_m,north_m,up_m,record\n"
BEARINGS = np.radians([20.0, 95.0, 160.0, 215.0, 280.0, 340.0])
PLACE = ("charge_east_m", "charge_north_m")


def log_of(folder, recorder, gauges):
    """A log of simulated gauges all around the charge, clipped or not."""
    rng = np.random.default_rng(8)
    records = recorded(rng, readings(rng, scatter=True), recorder)
    rows = HEAD
    for gauge in gauges:
        one = records[gauge]
        pairs = zip(one.time_s.tolist(), one.samples.tolist(), strict=True)
        text = "time_s,pressure_pa\n" + "".join(f"{t:.9f},{p:.3f}\n" for t, p in pairs)
        (folder / f"g{gauge}.csv").write_text(text)
        east = RANGES[gauge] * np.sin(BEARINGS[gauge])
        north = RANGES[gauge] * np.cos(BEARINGS[gauge])
        rows += f"g{gauge},overpressure_record,,,{east},{north},0,g{gauge}.csv\n"
    path = folder / "log.csv"
    path.write_text(rows)
    return read(path)


def answer(log, *free):
    """Mass and what else is free, their 90 % intervals."""
    asked = with_laws(freed(default_scene(), ["charge_mass_kg", *free]), LAWS)
    found = fit(log, asked)
    jax.clear_caches()
    return found.summary.estimates


@pytest.mark.slow  # programs of five samples' likelihoods
def test_mass_time_and_place_come_from_samples_together(tmp_path):
    log = log_of(tmp_path, Recorder(snr=20.0), (1, 2, 3, 4, 5))
    found = answer(log, "origin_time_s", *PLACE)
    truth = {"charge_mass_kg": MASS, "origin_time_s": 0.0, **dict.fromkeys(PLACE, 0.0)}
    for name, true in truth.items():
        one = found[name]
        # twice the half width of 90 %: one fit in 2,000 is farther off by chance
        half = one.q95 - one.q05
        assert abs(one.value - true) < half, name
    # the arrival's law is good to some per mille of a path of 10 to 40 m
    assert all(found[name].q95 - found[name].q05 < 5.0 for name in PLACE)
    # laws scatter by 10 % a shot, which no record takes away
    assert 0.02 < np.log(found["charge_mass_kg"].q95 / MASS) < 0.6


@pytest.mark.slow
def test_clipped_records_still_hold_the_mass_and_tell_less(tmp_path):
    widths = []
    for name, left in (("whole", None), ("clipped", 0.6)):
        folder = tmp_path / name
        folder.mkdir()
        log = log_of(folder, Recorder(snr=20.0, full_scale=left), (2, 3, 4))
        mass = answer(log)["charge_mass_kg"]
        widths.append(float(np.log(mass.q95 / mass.q05)))
        assert abs(np.log(mass.value / MASS)) < widths[-1]
    # of what is cut away nothing is made up: surer it cannot be, but for the laws'
    # scatter, which is most of either
    assert widths[1] > 0.98 * widths[0]
