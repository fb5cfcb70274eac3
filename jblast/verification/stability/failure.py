"""A failure mode of a method: its condition, its effect, and jblast's response.

Its boundary is found as a root, or as the value where a condition changes from true to
false. The map of failure modes has areas, each with the functions that measure it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import root_scalar

from jblast.errors import InputError, nearest, shown, whole_number
from jblast.lazy import resolved

Response = Literal["marks", "refuses", "falls back", "holds"]
"""Response of jblast where a method fails; "holds" if jblast avoids the failure."""


def crossing(
    function: Callable[[float], float], low: float, high: float, *, to: float = 1e-12
) -> float:
    """Return the zero of a function.

    Args:
        function: Function of one number, with different signs at `low` and `high`.
        low: Lower bound.
        high: Upper bound.
        to: Relative precision.
    """
    return float(root_scalar(function, bracket=(low, high), rtol=to).root)


def switching_point(
    answer: Callable[[float], bool | np.bool_],
    low: float,
    high: float,
    *,
    to: float = 1e-12,
) -> float:
    """Return the point at which a condition changes, by bisection.

    Args:
        answer: Condition, true at one of `low` and `high` only.
        low: Lower bound.
        high: Upper bound.
        to: Relative precision.
    """
    # +-0.5 gives the root finder the sign change that a truth value lacks
    found = root_scalar(
        lambda x: 0.5 - bool(answer(x)), bracket=(low, high), method="bisect", rtol=to
    )
    return float(found.root)


def first_failure(failed: Bool[np.ndarray, " level"], what: str) -> int:
    """Return the first level at which a method fails.

    Args:
        failed: True where the method fails, by level, easiest first.
        what: Name of the method, for the message.

    Raises:
        RuntimeError: It fails at no level, so the levels contain no boundary.
    """
    if not failed.any():
        raise RuntimeError(
            f"{what}: expected a failure at one of {failed.size} levels, got none: the "
            "boundary lies beyond them"
        )
    return int(np.argmax(failed))


def boundary_at(
    limit: float,
    measured: Float[np.ndarray, " level"],
    levels: Float[np.ndarray, " level"],
    what: str,
) -> float:
    """Return the level at which a rising measure reaches a limit, interpolated.

    Args:
        limit: Largest accepted value of the measure.
        measured: Measure at each level, rising.
        levels: Levels, easiest first.
        what: Name of the method, for the message.

    Raises:
        RuntimeError: The measure does not pass the limit between two of the levels.
    """
    # np.interp would return an end of the levels without a warning
    if not measured[0] <= limit < measured[-1]:
        raise RuntimeError(
            f"{what}: expected {measured[0]:g} to {measured[-1]:g}, measured at "
            f"{levels[0]:g} and {levels[-1]:g}, to contain {limit:g}"
        )
    return float(np.interp(limit, measured, levels))


@dataclass(frozen=True)
class FailureMode:
    """One measured failure mode of one method.

    Attributes:
        area: A key of `AREAS`.
        method: The method, or the law and its quantity.
        failure: Short description of the failure.
        boundary: Begin of the failure, in the unit; a share of cases has "of N".
        unit: Unit of the boundary; "" for a pure number.
        beyond: Measured behaviour of the method alone past the boundary.
        response: Response of jblast past the boundary.
        message: The mark, the message, or the method that takes over.
    """

    area: str
    method: str
    failure: str = field(metadata={"key": "edge"})
    boundary: float
    unit: str
    beyond: str
    response: Response = field(metadata={"key": "deed"})
    message: str = field(metadata={"key": "said"})

    @property
    def cases(self) -> int:
        """Number N of a unit "of N"; 0 for any other unit."""
        of, _, number = self.unit.partition(" ")
        return whole_number(number) or 0 if of == "of" else 0


def verified(response: Response, seen: bool | np.bool_, what: str) -> Response:
    """Return a response that was observed, so that no table states any other.

    Args:
        response: Stated response of jblast.
        seen: True if the measurement has shown this response.
        what: Subject, for the message.

    Raises:
        RuntimeError: The response was not observed.
    """
    if not seen:
        raise RuntimeError(
            f'{what}: expected the response "{response}", got another one: the table '
            "of failure modes no longer describes jblast"
        )
    return response


_MODULES = "jblast.verification.stability"
AREAS = {
    "laws": (f"{_MODULES}.laws:law_failures",),
    "wave forms": (f"{_MODULES}.waveforms:wave_form_failures",),
    "gradients": (f"{_MODULES}.laws:gradient_failures",),
    "clocks": (f"{_MODULES}.laws:clock_failures",),
    "solver": (f"{_MODULES}.waveforms:solver_failures",),
    "fits": (
        f"{_MODULES}.fits:poor_start_failures",
        f"{_MODULES}.fits:collinear_failure",
        f"{_MODULES}.fits:one_place_failure",
        f"{_MODULES}.fits:outlier_failure",
        f"{_MODULES}.fits:null_direction_failure",
    ),
    "walks": (
        f"{_MODULES}.fits:found_failure",
        f"{_MODULES}.fits:weighed_failure",
        f"{_MODULES}.fits:mirror_failure",
        f"{_MODULES}.fits:null_failure",
        f"{_MODULES}.fits:endless_failure",
        f"{_MODULES}.fits:bent_failure",
    ),
    "events": (f"{_MODULES}.camera:event_failures",),
    "flights": (f"{_MODULES}.flights:flight_failures",),
    "detectors": (
        f"{_MODULES}.detectors:detector_failures",
        f"{_MODULES}.detectors:flash_failures",
    ),
    "records": (f"{_MODULES}.detectors:record_failures",),
}
"""Functions that measure the failure modes of each area, by place (`jblast.lazy`).

Names of areas are listed without JAX, and MCMC is measured without Warp.
"""


def area_named(word: str) -> str:
    """Return an area by its name, hyphens and underscores read as spaces.

    Raises:
        InputError: There is no such area; the message lists all.
    """
    name = word.strip().lower().replace("-", " ").replace("_", " ")
    if name not in AREAS:
        known = [area.replace(" ", "-") for area in AREAS]
        raise InputError(
            f"area {shown(word)}: expected one of {', '.join(known)}"
            f"{nearest(word, known)}"
        )
    return name


def measures_of(area: str) -> tuple[Callable[[], FailureMode | list[FailureMode]], ...]:
    """Return the functions that measure the failure modes of an area.

    Args:
        area: A name of `AREAS`.
    """
    return tuple(resolved(place) for place in AREAS[area])


def failure_modes_of(area: str) -> list[FailureMode]:
    """Measure the failure modes of one area.

    Args:
        area: A name of `AREAS`.
    """
    modes = []
    for measure in measures_of(area):
        found = measure()
        modes += [found] if isinstance(found, FailureMode) else found
    return modes
