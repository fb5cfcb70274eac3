"""Which added datum would tell what a log cannot."""

from collections.abc import Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.identifiability.findings import Cure, ResolvingDatum, Where
from jblast.inference.mode.starts import layout_size, typical_step
from jblast.inference.posterior.fireball_growth import GROWTH
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.observations import CLOCK_TIMES, TIMES
from jblast.parameters import CLOCK_OFFSET
from jblast.quantities import ADDABLE, BY_CAMERA
from jblast.scene import Scene
from jblast.sensors import Layout, record, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.record import to_error_scale

BANG = "air_arrival_s"
RESOLVED_CHANGE = 0.03
"""A datum is a cure if a typical step along the direction moves it by 3 %."""


def candidates(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> tuple[Layout, list[ResolvingDatum]]:
    """Return rows that could be added to a log, and what each is.

    Each quantity at a sensor of the log, and at a place off the sensors' line, no
    nearer to them than the nearest is to the charge.
    """
    layout = posterior.layout
    position = np.asarray(layout.position)
    given = np.asarray(layout.slant_range)
    places: list[tuple[np.ndarray, float, Where]] = [(position[0], given[0], "sensor")]
    if np.isnan(given).all():
        reach = float(np.min(posterior.misfit(jnp.asarray(z)).slant_range))
        apart = float(np.max(np.ptp(position, axis=0))) > 0
        new = aside(posterior, reach)
        places.append((new, np.nan, "aside" if apart else "place"))
    else:
        places.append((position[0], 2 * np.nanmax(given), "range"))
    rows = [(q, *place) for q in ADDABLE for place in places]
    data = [ResolvingDatum(q, where) for q, _, _, where in rows]
    return Layout(
        quantity=tuple(q for q, *_ in rows),
        position=jnp.asarray(np.array([p for _, p, _, _ in rows])),
        slant_range=jnp.asarray([r for _, _, r, _ in rows]),
        time=jnp.full(len(rows), jnp.nan),
        group=tuple(range(len(rows))),
        shot=(0,) * len(rows),
        clock=("",) * len(rows),
    ), data


def aside(posterior: Posterior, reach: float = 0.0) -> Float[np.ndarray, "3"]:
    """Return a place off the sensors' line, as far from their middle as they spread.

    Args:
        posterior: Knows the sensors.
        reach: It is no nearer than this [m].
    """
    position = np.asarray(posterior.layout.position)
    middle, size = position.mean(axis=0), max(float(layout_size(posterior)), reach)
    _, _, axes = np.linalg.svd((position - middle)[:, :2], full_matrices=True)
    return middle + size * np.array([*axes[-1], 0.0])


def cure_of_null(
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    direction: Float[np.ndarray, " free"],
) -> Cure:
    """Return which data, or which priors, would end a null direction."""
    layout, possible = candidates(posterior, z)
    scene = posterior.parameters.scene_at(jnp.asarray(z))
    laws = laws_beside(posterior, scene, layout)

    scale = np.asarray(typical_step(posterior))
    _, moved = jax.jvp(
        lambda z: log_reading(posterior, layout, laws, z),
        (jnp.asarray(z),),
        (jnp.asarray(direction / np.max(np.abs(direction) / scale)),),
    )
    data = [
        datum
        for datum, seen in zip(possible, np.abs(moved) > RESOLVED_CHANGE, strict=True)
        if seen
    ]
    taking_part = tuple(
        name
        for name, weight in zip(posterior.parameters.names, direction, strict=True)
        if weight != 0
    )
    clocks = any(name.startswith(f"{CLOCK_OFFSET}.") for name in taking_part)
    is_filmed = bool(set(BY_CAMERA) & set(posterior.layout.quantity))
    data = [
        replace(
            datum,
            on_right_clock=clocks and datum.quantity in CLOCK_TIMES,
            is_bang=is_filmed and datum.quantity == BANG,
        )
        for datum in _without_repeats(data)
    ]
    if GROWTH in taking_part:
        data.append(ResolvingDatum("fireball_radius_m", "later"))
    return Cure(taking_part, tuple(data))


def laws_beside(posterior: Posterior, scene: Scene, layout: Layout) -> dict[str, str]:
    """Return the log's own laws, and those that would be chosen for the rest."""
    return law_names(resolve_laws(scene, layout)) | {
        q: n for q, n in posterior.laws if q in layout.quantities()
    }


@kept
def log_reading(posterior, layout, laws, z) -> Float[Array, " row"]:
    """Readings of a layout in ln, or in units of a typical travel time."""
    scene = posterior.parameters.scene_at(z)
    value = record(scene, layout, laws).value
    timed = np.isin(layout.quantity, TIMES)
    typical = layout_size(posterior) / STANDARD_SOUND_SPEED
    return to_error_scale(jnp.where(timed, value / typical, value), layout.quantity)


def _without_repeats(data: Sequence[ResolvingDatum]) -> list[ResolvingDatum]:
    """Leave out a new place where a sensor of the log would do."""
    at_sensor = {datum.quantity for datum in data if datum.where == "sensor"}
    return [
        datum
        for datum in data
        if datum.where == "sensor" or datum.quantity not in at_sensor
    ]


def cure_of_ambiguity(
    posterior: Posterior,
    here: Float[np.ndarray, " free"],
    there: Float[np.ndarray, " free"],
) -> ResolvingDatum:
    """Return which datum differs most between two solutions."""
    layout, possible = candidates(posterior, here)
    scene = posterior.parameters.scene_at(jnp.asarray(here))
    laws = laws_beside(posterior, scene, layout)
    apart = np.abs(
        log_reading(posterior, layout, laws, jnp.asarray(here))
        - log_reading(posterior, layout, laws, jnp.asarray(there))
    )
    return possible[int(np.nanargmax(apart))]
