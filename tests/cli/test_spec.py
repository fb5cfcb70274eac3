"""Options that are read from the help text of a verb."""

import pytest

from jblast.cli.kinds import KINDS, kind
from jblast.cli.spec import VerbParser
from jblast.errors import InputError

TEXT = """Weigh records.

More of 5 %.

example:
  jblast weigh a.csv

input:
  RECORD...       path; records
  --home LAT,LON[,ALT]!  numbers; home
model:
  --vehicles N    integer = 1; number of
                  scenes
  --mode a|b      choice = a; mode
  --live [X]      positive ? 2; speed
  --law NAME      text*; law, repeatable
  --mass KG...    several mass; masses
  ...free
output:
  --verbose       all of 5 %
  ...out
"""


def parser() -> VerbParser:
    return VerbParser("jblast weigh", TEXT)


def test_options_have_their_kinds_and_defaults():
    words = "a b --home -1,2 --live --mass 1:100:3 2lb --law x --law y --free a,b"
    found = parser().parse_args(words.split())
    assert found.record == ["a", "b"]
    assert (found.home, found.vehicles, found.live) == ((-1.0, 2.0), 1, 2.0)
    assert found.mass == [pytest.approx((1.0, 10.0, 100.0)), (0.90718474,)]
    assert (found.law, found.free, found.mode) == (["x", "y"], ["a", "b"], "a")
    assert (found.verbose, found.json, found.force) == (False, False, False)
    bare = parser().parse_args(["a", "--home", "1,2,3"])
    assert (bare.live, bare.mass, bare.law, bare.free) == (None, None, [], [])


@pytest.mark.parametrize(
    ("name", "metavar", "word", "message"),
    [
        ("path", "", " ", "a path"),
        ("choice", "a|b|c", "d", "expected a or b or c, got 'd'"),
        ("number", "", "nan", "a finite number"),
        ("number", "", "1e300", "a size between"),
        ("positive", "", "-1", "a positive number"),
        ("size", "", "inf", "a positive number"),
        ("share", "", "1", "a share"),
        ("seed", "", "-1", "a whole number"),
        ("seed", "", str(2**63), "a whole number"),
        ("span", "", "2:1", "START before STOP"),
        ("span", "", "2", "START:STOP"),
        ("numbers", "X,Y,Z", "1,2", "X,Y,Z"),
        ("numbers", "A[,B]", "1,2,3", r"A\[,B\]"),
        ("several", "", "1,5", "which may be one number or two"),
        ("several", "", "1:2:1", "a COUNT"),
        ("several", "", "2:1:3", "write 1:2:3"),
        ("mass", "", "3ft", "a unit of mass"),
        ("mass", "", "3parsnip", "a unit of mass: kg, g, mg, lb, .*, as in 33lb"),
        ("mass", "", "5MT", "megatonne or tonne"),
        ("temperature", "", "20kg", "a unit of temperature"),
        ("share", "", "150%", "a share"),
        ("mass", "", "1,5kg", "a decimal point"),
        ("positive length", "", "-3ft", "a positive number"),
    ],
)
def test_a_wrong_value_is_refused(name, metavar, word, message):
    with pytest.raises(Exception, match=message):
        kind(name, metavar)(word)


@pytest.mark.parametrize(
    ("name", "word", "value"),
    [
        ("mass", "1kt", 1e6),
        ("mass", "2 Mt", 2e9),
        ("time", "12.4ms", 0.0124),
        ("pressure", "140dB", 200.0),
        ("temperature", "20C", 293.15),
        ("temperature", "-40 °F", 233.15),
        ("temperature", "288", 288.0),
        ("percentage", "50%", 0.5),
        ("share", "5%", 0.05),
    ],
)
def test_a_value_with_a_unit_is_in_si(name, word, value):
    assert kind(name, "")(word) == pytest.approx(value, rel=1e-15)


def test_digits_of_other_scripts_are_refused_by_name():
    with pytest.raises(InputError, match="--vehicles: expected the digits 0 to 9"):
        parser().parse_args(["a", "--home", "1,2", "--vehicles", "٣"])


def test_a_kind_that_does_not_exist_is_an_error():
    assert "text" in KINDS
    with pytest.raises(KeyError):
        kind("colour", "")
