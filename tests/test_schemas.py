"""JSON Schemas of the manual: they take what is read and printed, and nothing else."""

import json
import math
import tomllib
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import jblast
from docs.generate import documents
from docs.generate.scene_schema import scene_schema
from jblast.errors import InputError
from jblast.inference.design.added_data import AddedDatum, Sensitivity
from jblast.inference.design.cramer_rao import BoundSummary
from jblast.inference.fitting.wrong import (
    ExchangedSensors,
    WrongClock,
    WrongSensor,
)
from jblast.inference.identify import (
    Cure,
    EstimableCombination,
    NullDirection,
    OtherMode,
    ResolvingDatum,
)
from jblast.inference.posterior.parameters import Estimate, Spread
from jblast.observations.check import doubt
from jblast.report.check import check_answer
from jblast.report.choice import choice_answer
from jblast.report.design import BoundAnswer
from jblast.report.discovery import (
    DiscoveryAnswer,
    ExchangeableTerms,
    FoundEquation,
    FurtherEquations,
    KeptTerm,
    LeftOutTerm,
    NominalInterval,
)
from jblast.report.fit_report import fit_answer, fit_document
from jblast.report.picks import picks_answer
from jblast.report.provenance import provenance_of
from jblast.report.study import run_answer
from jblast.results import warning
from jblast.scene.reader import scene_from_document
from jblast.signals.picks import log_of
from jblast.study import run_into
from jblast.waves.choice import TakenLaw
from tests.report import example
from tests.report.picks.test_picks import found as picked
from tests.study.example import study_in

ROOT = Path(__file__).parents[1]
LOG = str(ROOT / "calibration" / "data" / "hta_1.csv")
SCENE = ROOT / "calibration" / "scenes" / "arrivals.toml"
DATUM = ResolvingDatum("air_arrival_s", "aside")
NULL = NullDirection({"charge_mass_kg": 1.0}, "ln", Cure(("origin_time_s",), (DATUM,)))
OTHER = OtherMode({"charge_mass_kg": 2.0}, ("charge_mass_kg",), 0.3, DATUM)
NEARBY = EstimableCombination("charge_mass_kg * wind", math.nan, 0.1, is_local=True)


def check(schema: dict[str, Any], document: Any) -> None:
    Draft202012Validator.check_schema(schema)
    Draft202012Validator(schema).validate(document)


def test_the_schema_of_a_scene_takes_what_the_reader_takes():
    schema = Draft202012Validator(scene_schema())
    folders = [ROOT / "calibration" / name for name in ("scenes", "studies", "data")]
    for path in (file for folder in folders for file in folder.rglob("*.toml")):
        document = tomllib.loads(path.read_text("utf-8"))
        if "outcomes" not in document:  # else a study
            schema.validate(document)
    for document in (
        {"charge": {"mass_kg": -1.0}},
        {"charge": {"mass_kg": {"normal": [1.0]}}},
        {"charge": {"position_m": [0.0, 0.0]}},
        {"air": {"relative_humidity": 1.5}},
        {"sensor": [{"name": "a", "records": {"air_arrival": 1e-3}}]},
        {"vehicle": {"model": "balloon"}},
        {"sensor": [{"name": "a", "bits": 7}]},
        {"sensor": [{"name": "a", "filter_hz": [20, "all"]}]},
        {"ambient": {"level_pa": 1.0, "slope_db_octave": 20}},
        {"air": {"absorption": 1}},
        {"charges": {}},
        {"schema": 2},
    ):
        assert not schema.is_valid(document), document
        with pytest.raises(InputError):
            scene_from_document(document, "scene.toml")


def test_the_schema_of_a_fit_takes_every_answer():
    fit = example.not_identifiable()
    rest = (2.5, 3, math.nan, 4, {"origin_time_s": Estimate()})
    full = replace(
        fit.summary,
        null_directions=(NULL,),
        ambiguities=(OTHER,),
        determined=(NEARBY,),
        explained_by=(
            WrongClock("c", *rest, -0.8, 0.01, None),
            WrongSensor("d", *rest),
            ExchangedSensors("e", *rest, "f"),
        ),
    )
    made = (fit, example.three_parameters(), example.with_outliers())
    for one in (*made, replace(fit, summary=full)):
        check(documents.schema("fit"), fit_document(one))
    written = json.loads(
        fit_answer(fit, provenance_of([LOG], SCENE, ("jblast", "fit"))).to_json()
    )
    assert written["provenance"]["scene"]
    check(documents.schema("fit"), written)


def test_the_schema_of_picks_takes_what_was_picked_and_what_was_not():
    found = picked({}, {"calibrated": False}, {"notes": ("cut_short",)})
    epoch = datetime(2020, 8, 4, 15, 8, tzinfo=UTC)
    later = found._replace(epoch=epoch, refused=(InputError("a.wav: is empty"),))
    for one in (found, later):
        document = picks_answer(one, log_of(one)).to_dict()
        assert document["not_in_log"]
        check(documents.schema("pick"), document)
        entries = fit_document(example.no_draws()) | {"picks": document["picks"]}
        check(documents.schema("fit"), entries)
    logs = {"a": fit_document(example.no_draws()), "b": {"error": "b.csv: is empty"}}
    check(documents.schema("fits"), {"schema": 1, "logs": logs})
    check(documents.schema("fits"), {"schema": 1, "logs": logs, "picks": []})


def test_the_schema_of_a_bound_takes_every_answer():
    datum = AddedDatum(
        quantity="air_arrival_s",
        sensor="",
        position=np.array([1.0, 2.0, 0.0]),
        charge="",
        sigma=1e-3,
        is_default=True,
        law="kingery_bulmash",
        law_valid=True,
        parameter="charge_mass_kg",
        left=Spread(0.1, 0.2),
    )
    summary = BoundSummary(
        at={"charge_mass_kg": 25.0},
        law={"air_arrival_s": "kingery_bulmash"},
        law_reason={"air_arrival_s": TakenLaw("kingery_bulmash")},
        law_valid=True,
        parameters={"charge_mass_kg": Spread()},
        free=("charge_mass_kg",),
        identifiable=False,
        null_directions=(NULL,),
        ambiguities=(OTHER,),
        determined=(NEARBY,),
        noise="student",
        n_observations=3,
        help=(datum, replace(datum, position=None, sensor="a", is_default=False)),
        leans_on=(Sensitivity("charge_mass_kg", "wind_east_m_s", Spread(), None),),
        mass_exponents={"air_arrival_s": (-0.1, -0.2)},
        warnings=(warning("mode_found_once"),),
    )
    check(documents.schema("bound"), BoundAnswer(summary).to_dict())


def test_the_schema_of_a_study_takes_one(tmp_path):
    ran = run_into(study_in(tmp_path), tmp_path / "store")
    check(documents.schema("study"), run_answer(ran).document.to_dict())


def test_the_schema_of_a_choice_takes_one():
    scene = jblast.read_scene(ROOT / "calibration/scenes/arrivals.toml")
    choice = jblast.choose(scene, "air_arrival_s", 0.01)
    check(documents.schema("choose"), choice_answer(choice).document.to_dict())


def test_the_schema_of_a_discovery_takes_what_was_found_and_what_was_not():
    equation = FoundEquation(
        equation="d(u)/dt = -0.3 u",
        terms=(KeptTerm("u", -0.3, -0.4, -0.2, 1.0),),
        left_out=(LeftOutTerm("u^2", 0.1),),
        exchangeable=(ExchangeableTerms("u", "u^2"),),
        noise_sd=0.1,
        misfit=math.inf,
        reproduced=False,
        law=True,
        doubts=("it runs away",),
        skill_not_seen=0.9,
        p_outside=math.nan,
    )
    answer = DiscoveryAnswer(
        rows=9,
        state=("u",),
        input=(),
        candidates=("u", "u^2"),
        threshold=0.05,
        ensemble=20,
        seed=0,
        certain=False,
        equations={"u": equation},
        one_degree_more=FurtherEquations(False, {"u": "d(u)/dt = 0"}),
        interval=NominalInterval(0.9, (0.7, 1.0)),
        repeated=(),
        reproduced=False,
        error_growth_s=None,
        held_out_segments=5,
    )
    schema = documents.schema("discover")
    for one in (answer, replace(answer, one_degree_more=None)):
        check(schema, one.to_dict())
    assert answer.to_dict()["equations"]["u"]["misfit"] is None
    unasked = answer.to_dict() | {"more": 1}
    assert not Draft202012Validator(schema).is_valid(unasked)


def test_the_schema_of_a_check_takes_faults_and_warnings():
    log = jblast.read(LOG)
    odd = [doubt("clock_of_one_row", (0,), clock="phone")]
    for faults in ([], [InputError(f"{LOG}: line 3, column value: expected a number")]):
        answer = check_answer(log, faults, odd, ["2 values in kPa"])
        check(documents.schema("check"), answer.document.to_dict())


@pytest.mark.parametrize(
    "name",
    [
        *("fit", "pick", "pick.picks", "bound", "calc", "check", "choose", "fly"),
        *("discover", "render", "events", "world", "serve"),
        *(
            "tune",
            "tune.estimates",
            "detect",
            "detect.arrivals",
            "detect.arrays",
            "listen",
        ),
    ],
)
def test_every_key_of_an_answer_is_told(name):
    table = documents.table(name)
    assert all(len(row.split("|")[2]) > 2 for row in table.splitlines())
    assert table.count("\n| `") >= (4 if name == "calc" else 8)
