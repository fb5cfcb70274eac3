import pytest

from calibration.under_determined import KINDS, ended, fault, logs


# arrivals at two sensors, pressures at two: one log in four was a crash
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS[:2], ids=lambda kind: kind.quantities[0])
def test_half_a_dozen_under_determined_logs_end_with_a_sentence(kind):
    dozen = [made for of, made in logs(12, kinds=2, seed=0) if of is kind]
    assert [fault(ended(made)) for made in dozen] == [""] * 6


@pytest.mark.slow
def test_under_determined_logs_of_every_kind_end_with_a_sentence():
    every = len(KINDS)
    made = logs(10 * every, every, seed=1)
    ends = [(kind, fault(ended(log))) for kind, log in made]
    assert [end for end in ends if end[1]] == []
