"""One clock or one sensor that spoils a log is named; an honest log accuses nobody."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import fit, solve
from jblast.inference.fitting.findings import WrongClock, WrongSensor
from jblast.inference.fitting.suspects import explained_by
from jblast.report import summary
from tests.inference.fitting.clocks_off import ASKED, MASS, NAMES, accused, heard


@pytest.mark.slow
def test_a_clock_that_is_off_is_named_with_what_to_type():
    found = fit(heard("arrivals", np.random.default_rng(3), clock={"c": -0.8}), ASKED)
    assert found.exit_code == 4
    (entry,) = found.summary.explained_by
    assert isinstance(entry, WrongClock)
    assert entry.name == "c"
    assert entry.parameter == "clock_offset_s.c"
    # 5 sd: one wrong alarm in a million seeds, and this one is fixed
    assert abs(entry.offset_s + 0.8) < 5 * entry.offset_sd
    mass = entry.estimates["charge_mass_kg"]
    assert abs(np.log(mass.value / MASS)) < 4 * mass.log_sd
    lines = summary(found).splitlines()
    said = " ".join(lines)
    # the doubt stands above every number
    assert said.index("take no") < said.index("Estimates")
    assert "--free clock_offset_s.c." in said
    assert "0.8 s behind" in said or "s behind" in said


def test_asked_one_by_one_no_sensor_of_an_honest_log_is_accused():
    made = heard("arrivals", np.random.default_rng(4))
    asked = []

    def without_one(log):
        asked.append(log)
        return solve(log, ASKED)

    assert explained_by(made, solve(made, ASKED), True, without_one) == ()
    assert len(asked) == len(NAMES)


@pytest.mark.slow  # of a whole fit, which asks them where the log does not fit
def test_an_honest_log_of_the_same_sensors_accuses_nobody():
    found = fit(heard("arrivals", np.random.default_rng(4)), ASKED)
    assert accused(found) == []
    assert found.exit_code == 0


def test_a_rest_that_has_no_answer_accuses_nobody_and_ends_nothing():
    made = heard("arrivals", np.random.default_rng(3), clock={"c": -0.8})
    solution = solve(made, ASKED)
    asked = []

    def refused(log):
        asked.append(log)
        raise InputError("no value of charge_mass_kg gives the log a probability")

    assert explained_by(made, solution, False, refused) == ()
    assert len(asked) == len(NAMES)  # each was tried


@pytest.mark.slow
def test_every_clock_off_by_much_is_found_and_nobody_else():
    rng = np.random.default_rng(11)
    ends = []
    for i in range(24):
        name, offset = NAMES[i % 6], rng.choice([-1, 1]) * 10 ** rng.uniform(-0.7, 0.7)
        found = fit(heard("arrivals", rng, clock={name: offset}), ASKED)
        ends.append((name, accused(found), found.exit_code))
    alone = sum(who == [name] for name, who, _ in ends)
    assert alone >= 21  # a geometry may let two be wrong alike
    assert all(code == 4 for *_, code in ends)
    assert all(name in who for name, who, _ in ends if who)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["arrivals", "both"])
def test_of_a_hundred_honest_logs_no_more_than_one_accuses_anybody(kind):
    rng = np.random.default_rng(12)
    said = [accused(fit(heard(kind, rng), ASKED)) for _ in range(100)]
    assert sum(bool(who) for who in said) <= 1


@pytest.mark.slow
def test_a_sensor_of_which_everything_is_wrong_is_named_and_not_its_clock():
    rng = np.random.default_rng(13)
    made = heard("both", rng, clock={"b": 0.5}, gain={"b": 30.0})
    found = fit(made, ASKED)
    assert found.exit_code == 4
    (entry,) = found.summary.explained_by
    assert (type(entry), entry.name) == (WrongSensor, "b")
    assert "put a # before its rows" in " ".join(summary(found).split())
    made = heard("both", rng, clock={"b": 0.5})
    (entry,) = fit(made, ASKED).summary.explained_by[:1]
    assert (type(entry), entry.name) == (WrongClock, "b")
