"""Doubts about a log in words: what was read, why it is odd, what it may be."""

from jblast.observations import Observations
from jblast.observations.check.doubt import Doubt
from jblast.report.check import magnitudes, plain, slips

SENTENCES = plain.SENTENCES | magnitudes.SENTENCES | slips.SENTENCES
"""By kind of doubt, what says it."""


def sentence(doubt: Doubt, observations: Observations) -> str:
    """Return a doubt as a sentence, without the place in the file."""
    return SENTENCES[doubt.kind](doubt, observations)
