"""Laws are chosen again at the answer until they settle."""

from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np

from jblast.fidelity import TakenLaw
from jblast.inference.fitting.solution import ROUNDS, Choices, settle_laws
from jblast.inference.mode.search import Optima
from jblast.inference.posterior.posterior import Posterior
from jblast.scene import Scene

LAYOUT: Any = SimpleNamespace(free_air=())


def of(law: str) -> Choices:
    """Choices that differ by one law."""
    return Choices(Scene(), LAYOUT, {"air_arrival_s": TakenLaw(law)})


def judged(rows):
    """A posterior of four rows, so many of which lie within their laws."""

    class Judged(Posterior):
        def misfit(self, z) -> Any:
            return SimpleNamespace(valid=np.arange(4) < rows)

    return object.__new__(Judged)


def searches(leads_to, valid=None):
    """A search whose answer with a law asks for the next one, and what was tried."""
    tried = []

    def search(choices):
        law = choices.laws["air_arrival_s"].name
        tried.append(law)
        rows = (valid or {}).get(law, 4)
        posterior = judged(rows)
        found = Optima(jnp.zeros((1, 1)), jnp.array([-float(len(tried))]))
        return posterior, found, of(leads_to[law])

    return search, tried


def test_laws_are_chosen_again_until_the_answer_keeps_them():
    search, tried = searches({"a": "b", "b": "c", "c": "d", "d": "d", "e": "e"})
    _, choices = settle_laws(of("a"), search)
    assert tried == ["a", "b", "c", "d"]  # three rounds
    assert choices.laws["air_arrival_s"].name == "d"
    search, tried = searches({"e": "e"})
    settle_laws(of("e"), search)
    assert tried == ["e"]


def test_laws_that_take_turns_leave_the_answer_that_lies_within_its_own():
    near = {"near": "far", "far": "near"}
    for valid, kept in (({"far": 0}, "near"), ({"near": 2}, "far"), ({}, "near")):
        search, tried = searches(near, valid)
        (_, _, there), choices = settle_laws(of("near"), search)
        assert tried == ["near", "far"]  # and no third time
        assert choices.laws["air_arrival_s"].name == kept
        assert not choices.agrees_with(there)  # of which the answer warns
    endless = {str(i): str(i + 1) for i in range(9)}
    search, tried = searches(endless)
    settle_laws(of("0"), search)
    assert len(tried) == 1 + ROUNDS
