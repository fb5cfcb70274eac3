"""Where and when, in degrees and by the calendar: numbers and words."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from jblast.inference.fitting.place import on_earth
from jblast.inference.posterior.parameters import Estimate
from jblast.report.fit_report import fit_document
from jblast.scene import Charge
from tests.report.fit.place.located import BEIRUT, located
from tests.report.made_up import changed

SENSORS = [(300, 0), (0, 300), (-300, -100)]
EPOCH = datetime(2020, 8, 4, 15, 8, 18, tzinfo=UTC)


def placed():
    """Return a fit 100 m north of the origin, known to 4 m east and 2 m north."""
    rng = np.random.default_rng(2)
    draws = np.array([0.0, 100.0]) + rng.normal(size=(20_000, 2)) * [4.0, 2.0]
    return located(SENSORS, draws, centre=(0.0, 100.0), frame=BEIRUT)


def dated(fit, value=0.3104, half=0.02, clocks=()):
    told = Estimate(value, half / 1.645, math.nan, value - half, value, value + half)
    estimates = dict(fit.summary.estimates) | {"origin_time_s": told}
    free = (*fit.summary.free, "origin_time_s", *clocks)
    place = fit.scene.charge.position_m
    charge = Charge(mass_kg=20.0, position_m=place, time_s=value)
    fit = replace(
        fit,
        summary=replace(fit.summary, estimates=estimates, free=free),
        observations=replace(fit.observations, epoch=EPOCH),
    )
    return changed(fit, scene=replace(fit.scene, charges=(charge,)))


def test_a_place_is_told_in_degrees_within_an_ellipse():
    place = on_earth(placed()).place
    assert place is not None
    # 100 m of the meridian, 110.92 km a degree at this latitude
    assert place.lat_deg == pytest.approx(BEIRUT.lat_deg + 100 / 110920, abs=1e-7)
    assert place.lon_deg == pytest.approx(BEIRUT.lon_deg, abs=1e-9)
    major, minor = place.ellipse_90_m or (0.0, 0.0)
    # sqrt(chi2_2 at 0.9) = 2.146; 20,000 draws tell an sd to 0.5 %
    assert (major, minor) == pytest.approx((2.146 * 4, 2.146 * 2), rel=0.03)
    assert place.ellipse_azimuth_deg == pytest.approx(90.0, abs=1.0)


def test_each_of_several_charges_has_its_place_and_time():
    fit = dated(placed())
    others = (Charge(position_m=(0.0, 500.0, 0.0), time_s=2.0, name="second"),)
    both = changed(fit, scene=replace(fit.scene, charges=(fit.scene.charge, *others)))
    document = fit_document(both)
    first, second = document["charges_on_earth"]
    assert (first["place"], second["charge"]) == (document["place"], "second")
    assert first["origin_time_utc"] == document["origin_time_utc"]
    assert second["origin_time_utc"] == "2020-08-04T15:08:20.000000Z"
    # 400 m further along the meridian, 110.92 km a degree
    north = second["place"]["lat_deg"] - first["place"]["lat_deg"]
    assert north == pytest.approx(400 / 110920, abs=1e-7)
