"""What a discovery found as `jblast discover --json` prints it, key by key."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from jblast.json_values import plain


@dataclass(frozen=True)
class KeptTerm:
    """A term of an equation.

    Attributes:
        term: What it is.
        coefficient: Its coefficient.
        q05: 5 % quantile of that over the ensemble.
        q95: 95 % quantile.
        inclusion: Share of the ensemble that has it.
    """

    term: str
    coefficient: float
    q05: float
    q95: float
    inclusion: float


@dataclass(frozen=True)
class LeftOutTerm:
    """A term that only some of the ensemble had.

    Attributes:
        term: What it is.
        inclusion: Share of the ensemble that has it.
    """

    term: str
    inclusion: float


@dataclass(frozen=True)
class ExchangeableTerms:
    """Two terms of which this record does not identify the right one.

    Attributes:
        term: A term of the equation.
        other: Nearly collinear candidate that could stand in its place.
    """

    term: str
    other: str


@dataclass(frozen=True)
class FoundEquation:
    """The equation of one column.

    Attributes:
        equation: In words.
        terms: Its terms.
        left_out: Terms that only some of the ensemble had.
        exchangeable: Pairs of terms that this record does not distinguish. The equation
            is not identified where there are any.
        noise_sd: Noise of the column.
        misfit: What the integrated equation misses, as a share of the column's spread.
        reproduced: Whether, integrated, it gives the column back.
        law: Whether it holds where its coefficients have not seen.
        doubts: What speaks against it, the gravest first.
        skill_not_seen: Share of the squared miss of a guess that it saves there.
        p_excess: Chance of noise that leaves more over.
        p_serial: Chance of noise whose remains go together more from row to row.
        p_outside: Chance of noise whose remains go more with a term not looked among.
    """

    equation: str
    terms: tuple[KeptTerm, ...]
    left_out: tuple[LeftOutTerm, ...]
    exchangeable: tuple[ExchangeableTerms, ...]
    noise_sd: float
    misfit: float
    reproduced: bool
    law: bool
    doubts: tuple[str, ...]
    skill_not_seen: float
    p_excess: float
    p_serial: float
    p_outside: float


@dataclass(frozen=True)
class FurtherEquations:
    """The equations among products of one column more.

    Attributes:
        certain: Whether all of them are law.
        equations: By column, in words.
    """

    certain: bool
    equations: Mapping[str, str]


@dataclass(frozen=True)
class NominalInterval:
    """What the intervals are worth.

    Attributes:
        nominal: Their level.
        held_when_simulated: Share of noisy records that held the truth, least and most.
    """

    nominal: float
    held_when_simulated: tuple[float, float]


@dataclass(frozen=True)
class DiscoveryAnswer:
    """What was asked, and what was found.

    Attributes:
        rows: Of the trajectory.
        state: Columns that equations were sought for.
        input: Columns that drive them.
        candidates: Terms that were looked among.
        threshold: Least share of a derivative for a term to stay.
        ensemble: Records with new noise.
        seed: Of that noise.
        certain: Whether all of it is law.
        equations: By column.
        one_degree_more: The same of more candidates, where there was a doubt.
        interval: What intervals are worth.
        repeated: Terms that others add up to on this record.
        reproduced: Whether the equations give the data back.
    """

    rows: int
    state: tuple[str, ...]
    input: tuple[str, ...]
    candidates: tuple[str, ...]
    threshold: float
    ensemble: int
    seed: int
    certain: bool
    equations: Mapping[str, FoundEquation]
    one_degree_more: FurtherEquations | None
    interval: NominalInterval
    repeated: tuple[str, ...]
    reproduced: bool

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON can hold it; null is what is not a finite number."""
        return {f.name: plain(getattr(self, f.name)) for f in fields(self)}
