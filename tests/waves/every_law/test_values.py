"""Every law computes alike in batches and precisions, and says where it holds."""

import jax
import numpy as np
import pytest

from jblast.registry import Law
from tests.waves.every_law.laws import (
    CHOICES,
    arguments,
    compiled,
    evaluate,
    every_law,
    grid,
    sweep,
    words_of,
)

# Single against double precision, in ln of the result: one rounding is 6e-8. Laws that
# are one division, or products of powers, err by few of them; curves summed in ln round
# ln y of up to 20 to 1e-6 (reflected pressure by Kingery and Bulmash is worst, 4e-6).
SINGLE_PRECISION = 1e-5
SHARPER = {"light": 2e-7, "acoustic": 2e-7, "wu_hao": 2e-6, "sedov_taylor": 2e-6}


@pytest.mark.slow
@every_law
def test_jit_changes_nothing_and_a_batch_is_a_loop(law, word):
    values, _ = sweep(law)
    # compiled: jit of vmap of a law of numbers; here: the law of arrays, as it stands
    fused = compiled(law, word)(values)[0]
    with jax.disable_jit():  # a law compiles itself when called
        eager = evaluate(law, word, values)
    assert eager.shape == fused.shape
    # In ln, so that a law that spans decades is held equally everywhere. Fused
    # multiply-adds move the last bits of polynomials that cancel.
    np.testing.assert_allclose(fused, np.log(eager), rtol=0, atol=1e-12)
    alone = evaluate(law, word, {name: float(v[123]) for name, v in values.items()})
    assert alone.shape == ()
    np.testing.assert_allclose(alone, eager[123], rtol=1e-12)


@every_law
def test_numbers_broadcast_against_arrays(law, word):
    numbers = {name: float(value[1]) for name, value in grid(4, seed=4).items()}
    for name in arguments(law):
        together = jax.eval_shape(
            lambda x, name=name: evaluate(law, word, {**numbers, name: x}),
            jax.ShapeDtypeStruct((2, 3), float),
        )
        assert together.shape == (2, 3), name


@pytest.mark.slow
@every_law
def test_single_precision_stays_close_to_double(law, word):
    values = {name: v.astype(np.float32) for name, v in sweep(law)[0].items()}
    single = jax.jit(lambda v: evaluate(law, word, v))(values)
    assert single.dtype == np.float32
    # the same rounded numbers in double, so that rounding the input is not counted
    double, *_ = compiled(law, word)(
        {name: v.astype(float) for name, v in values.items()}
    )
    apart = np.abs(np.log(np.asarray(single, float)) - double)
    assert apart.max() < SHARPER.get(law.name, SINGLE_PRECISION)


@every_law
def test_each_says_where_it_holds_and_how_far_nature_departs(law, word):
    values = {**grid(60, seed=6), "burst": "surface", "ground_path": "head"}

    # Path calls by name; a law without a burst may still hold for one of them alone
    def call(f, **choice):
        chosen = values | choice
        return f(**{n: chosen[n] for n in Law.arguments(_as_law(law, f))})

    key = words_of(law) or "burst"
    somewhere = np.zeros(60, bool)
    for choice in (word,) if words_of(law) else CHOICES["burst"]:
        valid = jax.jit(lambda choice=choice: call(law.valid, **{key: choice}))()
        assert valid.shape == (60,)
        assert valid.dtype == bool
        somewhere |= np.asarray(valid)
    assert somewhere.any()
    for sd in call(law.scatter):
        assert np.all(np.isfinite(sd))
        assert np.all(np.asarray(sd) >= 0)
    assert law.range
    assert law.source
    assert law.scatter_source


def _as_law(law, function):
    return Law(**{**vars(law), "function": function})
