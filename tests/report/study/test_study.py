"""Reports on data sets in the layout of a study, made of known numbers."""

import dataclasses
import json

import numpy as np
import pytest
import xarray
from jsonschema import Draft202012Validator

from docs.generate import documents
from jblast.errors import InputError
from jblast.report.output import draw, write_answer
from jblast.report.study import report_answer
from jblast.report.study_figures import shares_on_grid
from jblast.report.view import Lines, Picture, terminal
from jblast.study import run_into
from jblast.study.columns import ALL, columns_of, read_columns
from jblast.study.outcome.family import FAMILIES
from tests.study.example import STUDY, study_in

ATTRIBUTES = {
    "jblast_study_schema": 2,
    "study": 'outcomes = ["above_threshold"]\noptions.threshold_pa = 5e4',
    "study_sha256": "ab",
    "scene": "[charge]",
    "scene_sha256": "cd",
    "seed": 3,
    "design": "random",
    "complete": True,
    "jblast": "0.2.0",
}
MASSES, RANGES = np.array([1.0, 3.0, 10.0]), np.array([5.0, 10.0, 20.0, 40.0])


def column(values, role, units="1", dims: object = "draw", **more):
    return dims, values, {"role": role, "units": units, "long_name": f"a {role}"} | more


def crossed(draws=50):
    """Two axes and one over words; half survive at a range of 4 W^(1/2)."""
    rng = np.random.default_rng(1)
    mass, away, _ = np.meshgrid(MASSES, RANGES, [0, 1], indexing="ij")
    wind = rng.normal(size=(draws, *mass.shape))
    score = np.log(away / 4) - 0.5 * np.log(mass) + 0.1 * wind
    survives = (score + 0.3 * rng.normal(size=wind.shape) > 0).astype(np.int8)
    survives[0, 0, 0, 0] = -1
    names = ("charge_mass_kg", "range_m", "vehicle.model")
    dims, units = ("draw", *names), ("kg", "m", "1")
    axes = (MASSES, RANGES, np.array(["crazyflie", "px4"], object))
    columns = {
        "wind_m_s": column(wind, "input", "m/s", dims),
        "survives": column(survives, "outcome", dims=dims, kind="yes_no"),
        "deviation_m": column(np.exp(-score), "outcome", "m", dims, kind="number"),
    }
    return xarray.Dataset(
        columns,
        {
            name: column(values, "axis", unit, name)
            for name, values, unit in zip(names, axes, units, strict=True)
        },
        ATTRIBUTES | {"columns": list(columns)},
    )


def per_sensor(samples=300, **attributes):
    """A pressure that depends on the mass and has scatter, but on no wind."""
    rng = np.random.default_rng(2)
    mass = rng.lognormal(2.0, 0.3, samples)
    scatter = np.exp(rng.normal(0, 0.1, (samples, 1)))
    pressure = 1e4 * mass[:, None] ** [[0.5, 0.4]] * scatter
    pressure[3 % samples, 1] = np.nan
    dims = ("draw", "sensor")
    values = column(pressure, "outcome", "Pa", dims, kind="number")
    columns = {
        "charge_mass_kg": column(mass, "input", "kg"),
        "wind_m_s": column(rng.normal(size=samples), "input", "m/s"),
        "peak_overpressure_pa": values,
    }
    about = ATTRIBUTES | {"columns": list(columns)} | attributes
    return xarray.Dataset(columns, {"sensor": ["a", "b"]}, about)


@pytest.fixture(scope="module")
def columns():
    return columns_of(crossed())


@pytest.fixture(scope="module")
def answer(columns):
    return report_answer(columns, "study.zarr")


def test_numbers_are_those_of_the_samples():
    lane = columns_of(per_sensor()).lanes[1]
    found, known = lane.statistics(), lane.values[~np.isnan(lane.values)]
    assert (found["count"], found["lost"]) == (299, 1)
    assert found["mean"] == pytest.approx(known.mean(), rel=1e-12)
    assert found["q50"] == np.quantile(known, 0.5, method="inverted_cdf")


def test_each_cell_has_its_own_samples(answer):
    cells = [one for one in answer.document.cells if one.outcome == "survives"]
    assert len(cells) == MASSES.size * RANGES.size * 2
    assert list(cells[0].axes.values()) == ["1", "5", "crazyflie"]
    assert cells[0].found["count"] + cells[0].found["lost"] == 50


def test_shares_on_the_grid_cross_a_half_at_the_known_range(columns):
    lane = next(one for one in columns.lanes if one.kind == "yes_no")
    shares, low, high = shares_on_grid(lane, ALL, *reversed(columns.numeric_axes))
    assert shares.shape == (MASSES.size, RANGES.size)
    assert ((low <= shares) & (shares <= high)).all()
    # 5 m of 1 kg is 1.25 times its limit, of 10 kg 0.4 of it
    assert shares[0, 0] > 0.5 > shares[2, 0]


def test_the_document_satisfies_its_schema(answer):
    document = json.loads(answer.document.to_json())
    Draft202012Validator(documents.schema("study_report")).validate(document)
    assert document["axes"]["vehicle.model"] == ["crazyflie", "px4"]
    shares = {one["outcome"]: one["numbers"] for one in document["sensitivity"]}
    by_name = {one["name"]: one for one in shares["deviation_m"]}
    # ln of the deviation is a plane: range and mass have nearly all of it
    assert by_name["range_m"]["total"] > 0.5 > by_name["wind_m_s"]["total"]


def test_scatter_of_the_law_thresholds_and_inputs_without_effect_are_shown():
    found = report_answer(columns_of(per_sensor(4000)))
    lines = {x.title: x.shown for x in found.view.blocks if isinstance(x, Lines)}
    assert lines["Scatter without a parameter"][0].endswith("(scatter of the law)")
    without = "peak_overpressure_pa, a does not depend on wind_m_s"
    assert lines["Inputs without effect"][0] == without
    pictures = {one.name: one for one in found.view.blocks if isinstance(one, Picture)}
    axes = pictures["sensitivity.png"].draw().axes[0]
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == ["charge_mass_kg", "wind_m_s", "scatter of the law"]
    drawn = pictures["exceedance.png"].draw().axes[0].get_legend_handles_labels()
    assert "threshold" in drawn[1]


def test_text_and_page_have_the_standard_error_of_a_share(answer, tmp_path):
    line = next(x for x in terminal(answer.view).splitlines() if "survives" in x)
    share = next(one for one in answer.document.outcomes if one.kind == "yes_no")
    assert f"{share.found['standard_error']:.2g}" in line
    written = write_answer(answer, tmp_path, "report")
    assert len([name for name in written if name.endswith(".png")]) == 5
    assert "± s.e." in (tmp_path / "report.html").read_text()


def test_names_of_a_study_cannot_write_to_the_page(tmp_path):
    data = per_sensor(40, study="a = '<script>alert(1)</script>'")
    write_answer(report_answer(columns_of(data), "<script>"), tmp_path, "report")
    assert "<script" not in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    "data",
    [
        per_sensor(4, jblast_study_schema=3),
        per_sensor(4, jblast_study_schema=None),
        xarray.Dataset({"x": ("statistic", [1.0])}, attrs=ATTRIBUTES),
    ],
)
def test_a_data_set_of_another_kind_is_refused(data):
    with pytest.raises(InputError, match="expected samples and jblast_study_schema 2"):
        columns_of(data)


def test_a_missing_store_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.zarr: no such store; expected a"):
        read_columns(str(tmp_path / "none.zarr"))


@pytest.mark.parametrize("samples", [1, 12])
def test_failed_samples_alone_make_figures_or_none(samples):
    flat = per_sensor(samples)
    flat["peak_overpressure_pa"][:] = np.nan
    blocks = report_answer(columns_of(flat)).view.blocks
    assert all(draw(one) for one in blocks if isinstance(one, Picture))


AXES = """
[axes]
charge_mass_kg = [1.0, 10.0]
charge_east_m = { from = -5, to = 10, count = 3 }
[options]
threshold_pa = 30000.0
"""
ASKED = STUDY.replace('["air_arrival_s"]', '["air_arrival_s", "above_threshold"]')


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    """Stores of one study: all samples, and the first ones."""
    folder = tmp_path_factory.mktemp("stores")
    with pytest.MonkeyPatch.context() as patch:
        few = dataclasses.replace(FAMILIES["quantities"], block=256, on_core=1)
        patch.setitem(FAMILIES, "quantities", few)
        for name, keep in {"all": '"all"', "some": 600}.items():
            study = study_in(folder, f"keep = {keep}\n{ASKED}{AXES}")
            run_into(study, folder / name)
        run_into(study_in(folder, ASKED + AXES), folder / "part", limit=500)
    return folder


def report_on(store):
    return report_answer(read_columns(store)).document.to_dict()


@pytest.mark.slow  # three studies are run
@pytest.mark.parametrize("name", ["some"])
def test_statistics_alone_give_the_tables_of_all_samples(stores, name):
    ours, exact = report_on(stores / name), report_on(stores / "all")
    assert ours["samples"] == exact["samples"] == 1800
    assert ours["axes"] == exact["axes"]
    for part in ("outcomes", "cells"):
        for one, other in zip(ours[part], exact[part], strict=True):
            found, all_of = one.pop("found"), other.pop("found")
            assert one == other
            spread = all_of.get("maximum", 1) - all_of.get("minimum", 0)
            near = {
                key: found.pop(key) for key in ("q05", "q50", "q95") if key in found
            }
            for key, value in near.items():
                assert value == pytest.approx(all_of.pop(key), abs=0.04 * spread)
            assert found == pytest.approx(all_of, rel=1e-11)


@pytest.mark.slow  # three studies are run
def test_sensitivities_come_from_stored_samples(stores):
    assert report_on(stores / "some")["sensitivity"][0]["rows"] == 768


@pytest.mark.slow  # three studies are run
def test_samples_that_are_not_computed_are_missing_and_not_failed(stores):
    found = report_on(stores / "part")
    assert found["samples"] == 576
    assert {one["found"]["lost"] for one in found["outcomes"]} == {0}
    assert "1,224 of 1,800 samples are missing" in found["notes"][0]
