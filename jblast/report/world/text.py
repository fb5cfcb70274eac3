"""What `jblast world` says on a terminal: the blasts, and who perceived what when."""

from collections.abc import Sequence

from jblast.report.tables import aligned
from jblast.report.world.document import warnings_of
from jblast.report.world.preset import preset_words
from jblast.report.world.run import WorldRun
from jblast.report.world.tables import blast_numbers

MOST_BLASTS, MOST_ENTITIES = 20, 12
"""Blasts and senses told one by one; all of them stand in the tables."""


def world_text(run: WorldRun) -> str:
    """Return the blasts, and a table of senses by blast: when each began."""
    charges = run.world.charges
    count = len(charges)
    lines = [f"{count} blast{'' if count == 1 else 's'} in {run.seconds:g} s", ""]
    if run.world.preset is not None:
        lines[:0] = [preset_words(run.world.preset), ""]
    if charges:
        lines += [*aligned(_blasts(run), right=range(1, 6)), ""]
        lines += aligned(_senses(run), right=range(2, 2 + MOST_BLASTS))
        lines += ["times on the common clock, in s", ""]
    lines += [f"Note: {warning}" for warning in warnings_of(run)]
    return "\n".join(lines) + "\n"


def _blasts(run: WorldRun) -> list[list[str]]:
    rows = [["blast", "time s", "east m", "north m", "up m", "mass kg"]]
    charges = run.world.charges
    for charge in charges[:MOST_BLASTS]:
        time, *others = blast_numbers(charge)
        rows.append([charge.name, f"{time:.4f}", *(f"{x:.4g}" for x in others)])
    return [*rows, *_more(len(charges), MOST_BLASTS, 6)]


def _senses(run: WorldRun) -> list[list[str]]:
    """Return a row for each sense of everyone, a column for each blast."""
    shots = run.world.shots[:MOST_BLASTS]
    began = {(p.entity, p.sense, p.shot): p.time_s for p in run.perceived}
    senses = list(dict.fromkeys((p.entity, p.sense) for p in run.perceived))
    senses.sort(key=lambda one: one[0])
    rows = [["who", "perceived", *(f"blast {shot}" for shot in shots)]]
    for who, sense in senses[:MOST_ENTITIES]:
        times = [began.get((who, sense, shot)) for shot in shots]
        rows.append([who, sense, *("-" if t is None else f"{t:.4f}" for t in times)])
    return [*rows, *_more(len(senses), MOST_ENTITIES, len(rows[0]))]


def _more(count: int, printed: int, columns: int) -> Sequence[list[str]]:
    if count <= printed:
        return []
    return [[f"and {count - printed} more", *[""] * (columns - 1)]]
