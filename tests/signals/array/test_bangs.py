"""Arrivals sorted by bang."""

from jblast.signals.arrays import bangs
from jblast.signals.detection import Detection

PLACES = {"a": (0.0, 0.0, 0.0), "b": (30.0, 0.0, 0.0)}  # 0.1 s apart


def heard(*times, statistic=10.0):
    return [Detection(time, 1e-3, 20.0, statistic) for time in times]


def test_what_is_nearer_than_sound_can_be_is_one_bang():
    found = bangs({"a": heard(1.0, 2.0), "b": heard(1.1, 2.3)}, PLACES)
    assert [{n: d.time_s for n, d in of.items()} for of in found.heard] == [
        {"a": 1.0, "b": 1.1},
        {"a": 2.0},
        {"b": 2.3},
    ]
    assert found.left_out == ()


def test_of_several_at_a_sensor_the_loudest_is_kept_and_the_other_told():
    loud, (quiet,) = heard(1.05, statistic=20.0), heard(1.0)
    found = bangs({"a": [quiet, *loud], "b": heard(1.02)}, PLACES)
    assert found.heard[0]["a"].time_s == 1.05
    assert found.left_out == (("a", quiet),)


def test_recorders_whose_clocks_differ_heard_one_bang():
    found = bangs({"a": heard(1.0), "b": heard(500.0)}, PLACES, one=True)
    assert len(found.heard) == 1


def test_nothing_heard_is_no_bang():
    assert bangs({"a": [], "b": []}, PLACES).heard == ()
