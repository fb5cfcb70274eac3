"""What speaks against an equation that was found, in words."""

from jblast.report.numbers import significant
from jblast.study.discovery.discover import Discovery
from jblast.study.discovery.judge import DOUBTFUL, FEWEST_MEMBERS
from jblast.study.discovery.replay import Replay


def doubts(found: Discovery, again: Replay, state: int) -> list[str]:
    """Return what speaks against one equation; the gravest first."""
    judged, name = found.judged[state], found.states[state]
    if not found.terms(state):
        return ["no term is certain"]
    words = [
        f"{term} and {other} are exchangeable: they are nearly collinear on this "
        "record, and either fits"
        for term, other in found.exchangeable[state]
    ]
    if not judged.law:
        words.append(
            "over stretches that its coefficients have not seen it comes hardly nearer "
            "than their start, or the mean elsewhere"
        )
    if not again.reproduced[state]:
        words.append(f"integrated from the first row it does not give {name} back")
    if not judged.tested:
        words.append(
            "whether what is left over is noise could not be judged: that takes "
            f"equations that give every state back, and {FEWEST_MEMBERS} or more "
            "records with new noise"
        )
    if judged.outside < DOUBTFUL:
        words.append(
            f"what is left over goes with {judged.outside_term}, which it was not "
            f"looked among (p = {significant(judged.outside, 2)})"
        )
    if judged.excess < DOUBTFUL:
        words.append(
            "more is left over than the noise would leave "
            f"(p = {significant(judged.excess, 2)})"
        )
    if judged.serial < DOUBTFUL:
        words.append(
            "what is left over is no independent noise "
            f"(p = {significant(judged.serial, 2)})"
        )
    return words


def certain(found: Discovery, again: Replay) -> bool:
    """Return whether nothing speaks against any equation."""
    return not any(doubts(found, again, state) for state in range(len(found.states)))


def doubts_text(found: Discovery, again: Replay, state: int) -> str:
    """Return the doubt about one equation as its headline; "" if there is none."""
    words = doubts(found, again, state)
    if not words:
        return ""
    is_law = found.terms(state) and found.judged[state].law
    first = "In doubt" if is_law else "No law found"
    return f"{first}, {found.states[state]}: {'; '.join(words)}"
