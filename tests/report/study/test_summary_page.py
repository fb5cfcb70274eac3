"""A report on statistics alone says what one on all samples says."""

import numpy as np
import pytest

from jblast.report.study_page import study_report
from jblast.report.study_stores import read_columns
from jblast.study import run_into
from jblast.study.sampling import work as work_module
from tests.study.example import STUDY, study_in

AXES = """
[axes]
charge_mass_kg = [1.0, 10.0]
charge_east_m = { from = -5, to = 10, count = 3 }
[options]
threshold_pa = 30000.0
"""
ASKED = STUDY.replace('["air_arrival_s"]', '["air_arrival_s", "above_threshold"]')
KINDS = {"all": '"all"', "summary": '"summary"', "some": "600"}


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reports")
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(work_module, "_tile_samples", lambda _: 256)
        for name, keep in KINDS.items():
            study = study_in(folder, f"keep = {keep}\n{ASKED}{AXES}")
            run_into(study, folder / name)
            found[name] = study_report(read_columns(str(folder / name)), name)
    return found


def named(one):
    return one["outcome"], one["sensor"], sorted(one["axes"].items())


def by_name(rows):
    return sorted(rows, key=named)


@pytest.mark.slow  # three studies are run
@pytest.mark.parametrize("name", ["summary", "some"])
def test_tables_are_those_of_all_samples(reports, name):
    ours, exact = reports[name].answer().to_dict(), reports["all"].answer().to_dict()
    assert ours["samples"] == exact["samples"] == 1800
    assert ours["axes"] == exact["axes"]
    for part in ("outcomes", "cells"):
        pairs = zip(by_name(ours[part]), by_name(exact[part]), strict=True)
        for one, other in pairs:
            assert named(one) == named(other)
            keys = ("share", "low", "yes") if "yes" in one["found"] else ("mean", "sd")
            for key in (*keys, "count", "lost"):
                assert one["found"][key] == pytest.approx(
                    other["found"][key], rel=1e-11
                )
            if "q50" in one["found"]:
                names = ("q05", "q50", "q95")
                near = [[x["found"][key] for key in names] for x in (one, other)]
                spread = other["found"]["maximum"] - other["found"]["minimum"]
                assert np.abs(np.subtract(near[0], near[1])).max() < 0.02 * spread


@pytest.mark.slow  # three studies are run
def test_what_scatter_comes_from_is_told_by_samples_that_were_kept(reports):
    assert not reports["summary"].answer().to_dict()["sensitivity"]
    found = reports["some"].answer().to_dict()["sensitivity"][0]
    assert found["rows"] == 600
