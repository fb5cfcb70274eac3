"""Reports on data sets in the layout of a study, made of numbers that are known."""

import json

import numpy as np
import pytest
import xarray
from jsonschema import Draft202012Validator

from docs.generate import documents
from jblast.errors import InputError
from jblast.report.study_columns import columns_of
from jblast.report.study_page import shares_on_grid, study_report
from jblast.report.study_results import summary_of
from jblast.report.study_stores import read_columns

ATTRIBUTES = {
    "jblast_study_schema": 1,
    "study": "samples = 1",
    "study_sha256": "ab",
    "scene": "[charge]",
    "scene_sha256": "cd",
    "seed": 3,
    "design": "random",
    "complete": True,
    "jblast": "0.2.0",
}
MASSES, RANGES = np.array([1.0, 3.0, 10.0]), np.array([5.0, 10.0, 20.0, 40.0])


def column(values, role, units="1", dims: object = "sample", **more):
    said = {"role": role, "units": units, "long_name": f"a {role}"} | more
    return dims, values, said


def crossed(draws=50, **attributes):
    """Two axes and one over words; survival is even where range is 4 W^(1/2)."""
    rng = np.random.default_rng(1)
    grid = np.meshgrid(np.arange(draws), MASSES, RANGES, [0, 1], indexing="ij")
    _, mass, away, model = (one.ravel() for one in grid)
    wind = rng.normal(size=mass.size)
    score = np.log(away / 4) - 0.5 * np.log(mass) + 0.1 * wind
    survives = (score + 0.3 * rng.normal(size=mass.size) > 0).astype(np.int8)
    survives[0] = -1
    return xarray.Dataset(
        {
            "charge_mass_kg": column(mass, "axis", "kg"),
            "range_m": column(away, "axis", "m"),
            "vehicle.model": column(
                model.astype(np.int16), "axis", names=["crazyflie", "px4"]
            ),
            "wind_m_s": column(wind, "input", "m/s"),
            "survives": column(survives, "outcome", kind="yes_no"),
            "deviation_m": column(np.exp(-score), "outcome", "m", kind="number"),
        },
        attrs=ATTRIBUTES | attributes,
    )


def per_sensor(samples=300, **attributes):
    rng = np.random.default_rng(2)
    mass = rng.lognormal(2.0, 0.3, samples)
    pressure = 1e4 * mass[:, None] ** [[0.5, 0.4]]
    pressure[3 % samples, 1] = np.nan
    return xarray.Dataset(
        {
            "charge_mass_kg": column(mass, "input", "kg"),
            "peak_overpressure_pa": column(
                pressure, "outcome", "Pa", ("sample", "sensor"), kind="number"
            ),
        },
        {"sensor": ["a", "b"]},
        ATTRIBUTES | attributes,
    )


@pytest.fixture(scope="module")
def report():
    return study_report(columns_of(crossed()), "study.zarr")


def test_numbers_are_those_of_the_samples():
    columns = columns_of(per_sensor())
    other = columns.lanes[1]
    found = summary_of(columns, other).found
    known = other.values[~np.isnan(other.values)]
    assert (found["count"], found["lost"]) == (299, 1)
    assert found["mean"] == pytest.approx(known.mean(), rel=1e-12)
    assert found["q50"] == np.quantile(known, 0.5, method="inverted_cdf")


def test_each_cell_has_its_own_samples(report):
    assert len(report.cells) == 2 * MASSES.size * RANGES.size * 2
    first = next(one for one in report.cells if one.lane.name == "survives")
    assert first.cell == ("1", "5", "crazyflie")
    assert first.found["count"] + first.found["lost"] == 50


def test_shares_on_the_grid_cross_a_half_where_they_should(report):
    columns = report.columns
    lane = next(one for one in columns.lanes if one.kind == "yes_no")
    across, up = columns.numeric_axes
    everything = np.ones(columns.samples, bool)
    shares, low, high = shares_on_grid(columns, lane, everything, across, up)
    assert shares.shape == (RANGES.size, MASSES.size)
    assert (low <= shares).all()
    assert (shares <= high).all()
    # 5 m of 1 kg is 1.25 times its limit, of 10 kg 0.4 of it
    assert shares[0, 0] > 0.5 > shares[0, 2]


def test_the_document_keeps_to_its_schema(report):
    document = json.loads(report.answer().to_json())
    Draft202012Validator(documents.schema("study_report")).validate(document)
    assert document["axes"]["vehicle.model"] == ["crazyflie", "px4"]
    shares = next(
        one for one in document["sensitivity"] if one["outcome"] == "deviation_m"
    )
    by_name = {one["name"]: one for one in shares["numbers"]}
    # ln of the deviation is a plane: range and mass have nearly all of it
    assert by_name["range_m"]["total"] > 0.5 > by_name["wind_m_s"]["total"]


def test_names_of_a_study_cannot_write_to_the_page():
    data = per_sensor(40, study="<script>alert(1)</script>")
    assert "<script" not in study_report(columns_of(data), "<b>").page()


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"jblast_study_schema": 2}, "expected schema 1 of a study, got 2"),
        ({"jblast_study_schema": None}, "got one without jblast_study_schema"),
    ],
)
def test_a_store_of_another_kind_is_refused(attributes, words):
    with pytest.raises(InputError, match=words):
        columns_of(per_sensor(40, **attributes))


def test_a_store_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.zarr: no such store; expected a"):
        read_columns(str(tmp_path / "none.zarr"))


def test_statistics_alone_are_refused():
    data = xarray.Dataset({"x": ("statistic", [1.0])}, attrs=ATTRIBUTES)
    with pytest.raises(
        InputError, match="expected samples, got a data set without any"
    ):
        columns_of(data)


def test_no_sample_and_nothing_that_varies_still_make_a_page():
    flat = per_sensor(12)
    flat["peak_overpressure_pa"][:] = np.nan
    assert study_report(columns_of(flat)).page()
    assert study_report(columns_of(per_sensor(1))).page()
