"""The areas of the map of failure modes, and the functions that measure them.

Each function imports its module when it is called: the names of areas are listed
without JAX, and MCMC is measured without Warp.
"""

from collections.abc import Callable

from jblast.errors import InputError, nearest, shown
from jblast.verification.stability.failure import FailureMode

Measure = Callable[[], FailureMode | list[FailureMode]]


def _laws() -> tuple[Measure, ...]:
    from jblast.verification.stability.laws import law_failures

    return (law_failures,)


def _wave_forms() -> tuple[Measure, ...]:
    from jblast.verification.stability.waveforms import wave_form_failures

    return (wave_form_failures,)


def _gradients() -> tuple[Measure, ...]:
    from jblast.verification.stability.laws import gradient_failures

    return (gradient_failures,)


def _clocks() -> tuple[Measure, ...]:
    from jblast.verification.stability.laws import clock_failures

    return (clock_failures,)


def _solver() -> tuple[Measure, ...]:
    from jblast.verification.stability.waveforms import solver_failures

    return (solver_failures,)


def _fits() -> tuple[Measure, ...]:
    from jblast.verification.stability.fits import (
        collinear_failure,
        null_direction_failure,
        one_place_failure,
        outlier_failure,
        poor_start_failures,
    )

    return (
        poor_start_failures,
        collinear_failure,
        one_place_failure,
        outlier_failure,
        null_direction_failure,
    )


def _walks() -> tuple[Measure, ...]:
    from jblast.verification.stability.walks import (
        bent_failure,
        endless_failure,
        found_failure,
        mirror_failure,
        null_failure,
        weighed_failure,
    )

    return (
        found_failure,
        weighed_failure,
        mirror_failure,
        null_failure,
        endless_failure,
        bent_failure,
    )


def _events() -> tuple[Measure, ...]:
    from jblast.verification.stability.camera import event_failures

    return (event_failures,)


def _flights() -> tuple[Measure, ...]:
    from jblast.verification.stability.flights import flight_failures

    return (flight_failures,)


def _detectors() -> tuple[Measure, ...]:
    from jblast.verification.stability.detectors import (
        detector_failures,
        flash_failures,
    )

    return (detector_failures, flash_failures)


def _records() -> tuple[Measure, ...]:
    from jblast.verification.stability.detectors import record_failures

    return (record_failures,)


AREAS: dict[str, Callable[[], tuple[Measure, ...]]] = {
    "laws": _laws,
    "wave forms": _wave_forms,
    "gradients": _gradients,
    "clocks": _clocks,
    "solver": _solver,
    "fits": _fits,
    "walks": _walks,
    "events": _events,
    "flights": _flights,
    "detectors": _detectors,
    "records": _records,
}
"""By the name of an area, what imports the functions that measure its failure modes."""


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


def failure_modes_of(area: str) -> list[FailureMode]:
    """Measure the failure modes of one area, here and now.

    Args:
        area: A name of `AREAS`.
    """
    found = [measure() for measure in AREAS[area]()]
    return [
        mode
        for one in found
        for mode in ([one] if isinstance(one, FailureMode) else one)
    ]
