"""jblast fly: flights of one vehicle and of several, and what is refused."""

import csv
import json

import pytest
from jsonschema import Draft202012Validator

from docs.generate.documents import schema
from tests.cli.cli_files import Command, says, table

CHARGE = "[charge]\nmass_kg = 1.0\n"
VEHICLE = '[vehicle]\nmodel = "crazyflie"\nposition_m = [5.0, 0.0, 2.0]\n'
OWN = "control = { integral = true }\n"
SHORT = ("--seconds", "0.6", "--step", "0.002")
"""So short that the vehicle is still away at the end."""
FILES = {"fly.json", "flight.csv", "flight.png", "report.html"}


def flown(jblast: Command, *options: str, scene: str = CHARGE + VEHICLE + OWN):
    return jblast("fly", jblast.file("scene.toml", scene), *SHORT, *options, "--debug")


def names(jblast: Command, folder: str) -> set[str]:
    return {path.name for path in (jblast.directory / folder).iterdir()}


def test_json_is_all_of_stdout_and_has_no_infinity(jblast):
    code, out, err = flown(jblast, "--json")
    assert (code, err) == (0, "")
    document = json.loads(out, parse_constant=pytest.fail)
    Draft202012Validator(schema("fly")).validate(document)
    assert document["scene_hold"] == "with_integral"
    assert document["blasts"][0]["in_range"] is True
    assert "in_range_share" not in document["blasts"][0]
    assert set(document["holds"]) == {"with_integral", "without_integral"}
    for hold in document["holds"].values():
        assert hold["recovery_time_s"] is None
        assert (hold["recovered"], hold["flies_on"], hold["lost"]) == (0, 1, 0)
        assert hold["peak_deviation_m"] > 0.05


@pytest.mark.slow
def test_files_are_written_once_and_the_flight_can_be_discovered(jblast):
    out = jblast.path("flight")
    code, said, err = flown(jblast, "--out", out)
    assert (code, err) == (0, "")
    assert "flight.png" in said
    assert names(jblast, "flight") == FILES
    with open(jblast.path("flight/flight.csv"), encoding="utf-8") as file:
        assert next(file).startswith("# crazyflie, position hold with integral action")
        rows = list(csv.DictReader(file))
    assert len(rows) == 301
    assert float(rows[0]["east_m"]) == 5.0
    assert float(rows[-1]["path_error_m"]) > 0.05
    # the thrust of a level vehicle is upwards
    assert float(rows[0]["pull_up"]) == pytest.approx(1.0, abs=1e-3)
    found = ("--state", "velocity_east_m_s", "--ensemble", "19")
    assert jblast("discover", f"{out}/flight.csv", *found)[0] in (0, 4)
    again = ("fly", jblast.path("scene.toml"), *SHORT, "--out", out)
    assert "exists already" in jblast.refused(*again)
    assert flown(jblast, "--out", out, "--force")[0] == 0


def test_a_crash_is_an_answer(jblast):
    heavy = CHARGE.replace("1.0", "30.0")
    code, out, err = flown(jblast, scene=heavy + VEHICLE + OWN)
    assert code == 0, err
    rows = [line.split() for line in out.splitlines()]
    assert ["crashed", "yes", "yes"] in rows
    assert ["flies", "on", "no", "no"] in rows


@pytest.mark.slow
def test_a_custom_profile_takes_the_place_of_the_laws(jblast):
    header = (
        "Time Delay (s),Distance (m),View Polar Angle (Deg.),View Azimuthal Angle "
        "(Deg.),FA (N*s),FS (N*s),FN (N*s),Ml (N*m*s),Mm (N*m*s),Mn (N*m*s)\n"
    )
    profile = jblast.file("p.csv", header + "0.02,5.0,90,180,0.01,0,0,0,0,0\n")
    scene = "[charge]\nmass_kg = 1.0\nposition_m = [0, 0, 2.0]\n" + VEHICLE
    code, out, err = flown(jblast, "--profile", profile, scene=scene)
    assert code == 0, err
    assert "20 ms" in out
    # a profile has impulses, and no pressure
    assert ["peak", "overpressure", "-", "-"] in [
        line.split() for line in out.splitlines()
    ]
    lacking = jblast.file("q.csv", header.replace("FN (N*s),", "") + "1,1,1\n")
    refused = ("fly", jblast.path("scene.toml"))
    said = jblast.refused(*refused, "--profile", lacking)
    assert "expected the columns FN (N*s)" in said
    about = ("--profile-moments-about", "100,0")
    assert "X,Y,Z" in jblast.refused(*refused, "--profile", profile, *about)
    about = ("--profile-moments-about", "1,0,0")
    assert "expected it with --profile only" in jblast.refused(*refused, *about)


# what of the scene is changed to what, then options
REFUSED = table("""
2.0] -> -2.0]; => scene.toml: [vehicle] position_m | -2 m
crazyflie -> crazyfly; => [vehicle] model | did you mean crazyflie?
mass_kg = 1.0 -> mass_kg = "free"; =>\
 scene.toml: charge_mass_kg: expected a value or a prior
[charge] / mass_kg = 1.0 ->; => or --seconds for a flight without a blast
VEHICLE ->; => [vehicle] | got none
->;--step 0.3 => step_s: expected at most
->;--step 0 => --step | positive
->;--seconds x => --seconds
->;--seconds 0.001 => seconds: expected more than
->;--tolerance -0.1 => --tolerance | positive
->;--vehicles 9 => expected a prior to sample
->;--vehicles 0 => vehicles | got 0
->;--backend cuda --seconds 1 => backend | 'cuda'
->;--profile none.csv => none.csv: no such file
->;--plan-out a.plan => --plan-out: expected a scene whose [vehicle] has a mission
""")


@pytest.mark.parametrize(("asked", "said"), REFUSED)
def test_what_cannot_be_flown_is_one_message(jblast, asked, said):
    change, _, options = asked.partition(";")
    change = change.replace("VEHICLE", VEHICLE.strip()).replace(" / ", "\n")
    old, new = (part.strip() for part in change.split("->"))
    scene = (CHARGE + VEHICLE).replace(old, new) if old else CHARGE + VEHICLE
    path = jblast.file("scene.toml", scene)
    says(jblast.refused("fly", path, *options.split()), said)


@pytest.mark.slow
def test_many_vehicles_have_a_distribution(jblast):
    scene = "[charge]\nmass_kg = { lognormal = [1.0, 2.0] }\n" + VEHICLE
    path, out = jblast.file("scene.toml", scene), jblast.path("many")
    asked = ("fly", path, *SHORT, "--vehicles", "5", "--seed", "3")
    code, said, err = jblast(*asked, "--out", out, "--debug")
    assert (code, err) == (0, "")
    assert said.startswith("5 x Crazyflie")
    assert "5 %, 50 %, 95 %" in said
    assert "100 % [64.89 to 100 %]" in said  # Wilson: 5 / (5 + 1.645^2)
    files = {"fly.json", "flights.csv", "distribution.png", "report.html"}
    assert names(jblast, "many") == files
    rows = list(csv.DictReader(jblast.text("many/flights.csv").splitlines()))
    assert len(rows) == 10
    masses = sorted(float(r["charge_mass_kg"]) for r in rows[:5])
    document = json.loads(jblast.text("many/fly.json"), parse_constant=pytest.fail)
    Draft202012Validator(schema("fly")).validate(document)
    drawn = document["drawn"]["charge_mass_kg"]
    assert list(drawn.values()) == pytest.approx([masses[0], masses[2], masses[4]])
    hold = document["holds"]["with_integral"]
    assert hold["flies_on_share"]["value"] == 1.0
    assert hold["lost_vehicles"] == []
    assert "flies_on" not in hold
