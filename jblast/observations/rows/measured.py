"""What each row of a log holds, and its value and sigma in our units.

The value is in the unit of its column (`value_kpa`), else in the one that its quantity
ends in; the sigma in that of its column (`sigma_percent`), else in that of its value.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from jaxtyping import Float

from jblast.observations.understood import Understood
from jblast.units import (
    LEVEL,
    LN_PER_DB,
    SHARE,
    OurName,
    overpressure,
    products,
    si_ratio,
)


@dataclass
class Measured:
    """Which of our quantities each row holds, and in which unit.

    Attributes:
        theirs: Quantities as written.
        quantity: Ours.
        units: Of quantities in another unit than ours, as written.
        columns: Units of columns that have one of their own.
    """

    theirs: tuple[str, ...]
    quantity: tuple[str, ...]
    units: dict[str, OurName]
    columns: Mapping[str, OurName]
    understood: list[Understood] = field(default_factory=list)

    def factors(self) -> Float[np.ndarray, " row"]:
        """Return what values are multiplied by; 1 for levels."""
        factors = np.ones(len(self.theirs))
        for unit, rows in self._by_unit():
            if unit is not None and unit.dimension != LEVEL:
                factors[rows] = unit.factor
        return factors

    def converts(self) -> bool:
        """Return whether anything has to be converted."""
        return bool(self.units) or bool(self.columns.keys() & {"value", "sigma"})

    def converted(
        self,
        texts: Mapping[str, Sequence[str]],
        value: Float[np.ndarray, " row"],
        sigma: Float[np.ndarray, " row"],
    ) -> tuple[Float[np.ndarray, " row"], Float[np.ndarray, " row"]]:
        """Return values and sigmas in our units, as products of what was written.

        Args:
            texts: Columns as written; `value` and `sigma` are looked at.
            value: What they are as numbers; NaN of what is none.
            sigma: The same.
        """
        if not self.converts():
            return value, sigma
        ours, errors = value.copy(), sigma.copy()
        for unit, rows in self._by_unit():
            values, sigmas = ([texts[of][r] for r in rows] for of in ("value", "sigma"))
            level = unit is not None and unit.dimension == LEVEL
            ratio = Fraction(1) if unit is None or level else si_ratio(unit.unit)
            if level:
                with np.errstate(over="ignore"):  # too large is refused by its row
                    ours[rows] = overpressure(value[rows])
            elif unit is not None:
                ours[rows] = products(ratio, values)
            own = self.columns.get("sigma")
            if own is None and not level:
                errors[rows] = products(ratio, sigmas)
            elif own is None or own.dimension == LEVEL:
                errors[rows] = sigma[rows] * LN_PER_DB * ours[rows]
            elif own.dimension != SHARE:
                errors[rows] = products(si_ratio(own.unit), sigmas)
            elif level:
                errors[rows] = sigma[rows] * own.factor * ours[rows]
            else:
                share = products(ratio * si_ratio(own.unit), values, sigmas)
                errors[rows] = np.copysign(share, sigma[rows])
        return ours, errors

    def _by_unit(self) -> Iterator[tuple[OurName | None, list[int]]]:
        """Give each unit, None of ours, and the rows whose values are in it."""
        own = self.columns.get("value")
        if own is not None and own.dimension != LEVEL:
            yield own, list(range(len(self.theirs)))
            return
        rows: dict[str, list[int]] = {}
        for row, name in enumerate(self.theirs):
            rows.setdefault(name, []).append(row)
        for name, held in rows.items():
            yield self.units.get(name), held
