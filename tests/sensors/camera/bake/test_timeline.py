import numpy as np
import pytest
from hypothesis import given, strategies

from jblast.errors import InputError
from jblast.sensors.camera.bake.recipe import LAST, PHASES, timeline
from jblast.waves.fireball import fireball_duration, fireball_growth_time


@given(number=strategies.integers(2, LAST))
def test_instants_rise_from_the_burst_to_smoke(number):
    instants = timeline(number)
    assert len(instants) == number
    assert (np.diff([i.step for i in instants]) > 0).all()
    assert (np.diff([i.phase for i in instants]) > 0).all()
    assert (np.diff([i.fade for i in instants]) <= 0).all()
    assert (instants[0].phase, instants[-1].phase) == (PHASES[0], PHASES[-1])
    assert (instants[0].step, instants[-1].step) == (1, LAST)


def test_embers_glow_until_the_fireball_is_over_and_not_much_longer():
    for instant in timeline(LAST):
        if instant.phase <= 0.85:
            assert instant.fade == 1.0
        if instant.phase >= 1.5:
            assert instant.fade == 0.0


def test_several_frames_show_the_growth_of_a_kilogram():
    """Its radius is at 95 % after three time constants."""
    grown = 3 * float(fireball_growth_time(1.0)) / float(fireball_duration(1.0))
    assert sum(instant.phase < grown for instant in timeline(40)) >= 4


@pytest.mark.parametrize("number", [1, 0, -1, LAST + 1])
def test_a_number_of_frames_that_cannot_be_is_refused(number):
    with pytest.raises(InputError, match=f"frames: expected 2 to {LAST}"):
        timeline(number)
