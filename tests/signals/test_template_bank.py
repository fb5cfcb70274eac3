import functools

import numpy as np
import pytest

from calibration.cases import RATE, coloured, rumble
from jblast.errors import InputError
from jblast.signals import best_match, template_bank

ROOTS, RANGES = np.geomspace(1.0, 3.0, 4), np.geomspace(60.0, 240.0, 4)
NOISE = rumble()._replace(density=100 * rumble().density)


@functools.cache
def bank():
    return template_bank(ROOTS, RANGES, RATE)


def bang(nth: int, gain: float) -> np.ndarray:
    sound = coloured(np.random.default_rng(3), NOISE, 2**15)[0]
    row = gain * bank()[nth].template
    sound[12_000:][: row.size] += row
    return sound


def test_a_bank_has_every_pair():
    pairs = {(round(m.cube_root_kg, 6), round(m.range_m, 6)) for m in bank()}
    assert len(pairs) == 16


@pytest.mark.parametrize("nth", [1, 6, 11])
def test_the_blast_that_was_is_the_best(nth):
    found = best_match(
        bang(nth, 1.0), bank(), RATE, noise_spectrum=NOISE, calibrated=True
    )
    assert found is not None
    assert found.best is bank()[nth]
    assert round(found.detection.time_s * RATE) == 12_000
    assert found.members == (found.best,)


def test_without_pascals_a_faint_blast_has_the_form_of_many():
    faint = bang(6, 0.03)
    free = best_match(faint, bank(), RATE, noise_spectrum=NOISE)
    assert free is not None
    assert len(free.members) > 3
    far = {m.range_m for m in free.members}
    assert len(far) > 1
    assert any(m is bank()[6] for m in free.members)


def test_noise_has_no_match():
    sound = coloured(np.random.default_rng(4), NOISE, 2**15)[0]
    assert best_match(sound, bank(), RATE, noise_spectrum=NOISE) is None


def test_an_empty_bank_is_refused():
    with pytest.raises(InputError, match="bank: expected at least one blast"):
        best_match(np.ones(9000), (), RATE)
