"""Identifiability: null directions, estimable combinations, and data that would help.

A null direction is a direction in the space of the fitted coordinates along which the
predictions stay the same within the errors. Candidates are eigenvectors of the Fisher
information, scaled by typical steps, of near zero eigenvalue. Each is confirmed by a
step of finite length, from which Gauss-Newton returns to the curve along which no
prediction changes. Without such a curve the derivative vanished by symmetry alone, and
the direction is identified. Combinations that vanish along all null directions are
estimable although their parameters are not. They are named like
`air_sound_speed_m_s * charge_mass_kg^0.2`.

For each null direction, additional data are compared by the change of their prediction
along it: every quantity at a sensor of the log, and at a position off the sensors'
line. Between two optima the datum whose prediction differs most is named. A prior on
any parameter of the direction resolves it as well.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.mode.starts import layout_size, typical_step
from jblast.inference.posterior.fisher_information import (
    NULL,
    TAKES_PART,
    information,
    unit_diagonal,
    whitened_jacobian,
    whitened_rows,
)
from jblast.inference.posterior.parameters import GROWTH
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.observations import CLOCK_TIMES, TIMES
from jblast.parameters import CLOCK_OFFSET
from jblast.quantities import ADDABLE, BY_CAMERA
from jblast.scene import Scene
from jblast.sensors import Layout, record, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.record import to_error_scale

STEP = 1.0
"""Distance over which a null direction is followed to confirm it, in typical steps."""
NULL_TOLERANCE = 1e-4
"""Data that change by less than this many standard deviations along a direction are
unchanged: far below any error, and above the rounding of large slopes."""
ROUNDS = 20
"""Largest number of Gauss-Newton steps back onto the curve of a null direction. They
converge quadratically; without convergence the direction is identified."""
HALVINGS = 12
"""Largest number of halvings of such a step until it reduces the misfit."""
RESOLVED_CHANGE = 0.03
"""A datum resolves a null direction if a typical step along it changes the datum by
more than this in ln: three times the 1 % by which laws scatter from path to path."""
Where = Literal["sensor", "place", "aside", "range", "later"]


@dataclass(frozen=True)
class Identifiability:
    """Null directions and identified directions of the parameters.

    Attributes:
        null: Null directions in the coordinates, one row each.
        identified_basis: Basis of the identified directions, one column each.
        determined: True for parameters without a component in any null direction.
        followed: End of a finite step along each null direction.
    """

    null: Float[np.ndarray, "null free"]
    identified_basis: Float[np.ndarray, "free identified"]
    determined: tuple[bool, ...]
    followed: Float[np.ndarray, "null free"]


def identifiability(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> Identifiability:
    """Find the null directions at a place, and confirm each by a finite step.

    A number with a prior is identified, however weak the prior. So its prior counts at
    least as much as the data.
    """
    scale = typical_step(posterior)
    known = np.asarray(information(posterior, jax.device_put(z)))
    # the information of data and prior once more, so that even a weak prior is above
    # `NULL`
    prior = np.diag(np.asarray(posterior.parameters.has_prior()) * np.diag(known))
    size, values, vectors = map(
        np.asarray, unit_diagonal(jax.device_put(known + prior), scale)
    )
    followed = [
        _followed(posterior, z, vector / size, size) if value < NULL else None
        for value, vector in zip(values, vectors.T, strict=True)
    ]
    data = len(posterior.measured) + int(np.sum(posterior.parameters.has_prior()))
    # With fewer data than unknowns that many directions are null by counting, even
    # where the finite step did not converge.
    for k in range(z.size - data):
        followed[k] = z if followed[k] is None else followed[k]
    is_null = np.array([there is not None for there in followed], dtype=bool)
    null = echelon(vectors[:, is_null].T)
    return Identifiability(
        null=_led_by_one(null / size),
        identified_basis=vectors[:, ~is_null] / size[:, None],
        determined=tuple(bool((column == 0).all()) for column in null.T),
        followed=np.array([t for t in followed if t is not None]).reshape(null.shape),
    )


def _followed(posterior, z, direction, size) -> np.ndarray | None:
    """Return the end of a finite step along a direction; None if the data change.

    A derivative can vanish by symmetry alone (a charge at the height of its sensors).
    Then a finite step changes the data. A true invariance may be curved (a charge on a
    circle about its only sensor), so after the step the identified directions are
    adjusted.
    """
    step = (
        STEP
        * direction
        / np.max(np.abs(direction) / np.asarray(typical_step(posterior)))
    )
    started = _whitened_prediction(posterior, z, z)
    there = z + step
    miss = _whitened_prediction(posterior, there, z) - started
    for _ in range(ROUNDS):
        if np.linalg.norm(miss) < NULL_TOLERANCE:
            # the adjustment may lead back to the start: then there is no curve
            away = np.linalg.norm((there - z) * size)
            return there if away > 0.5 * np.linalg.norm(step * size) else None
        jacobian = np.asarray(whitened_jacobian(posterior, jnp.asarray(there)))
        if not (np.isfinite(jacobian).all() and np.isfinite(miss).all()):
            return None
        back = -np.linalg.pinv(jacobian / size, rcond=1e-6) @ miss / size
        # near a cone (a range of zero) a full step leads far away: it is halved
        for part in 0.5 ** np.arange(HALVINGS):
            nearer = _whitened_prediction(posterior, there + part * back, z) - started
            with np.errstate(over="ignore"):  # an overflow compares as not nearer
                is_nearer = np.linalg.norm(nearer) < np.linalg.norm(miss)
            if is_nearer:
                there, miss = there + part * back, nearer
                break
        else:
            return None
    return None


def _whitened_prediction(posterior, z, where):
    """Predictions and prior terms at z, in the standard deviations at another place."""
    at, here = posterior.misfit(jnp.asarray(where)), posterior.misfit(jnp.asarray(z))
    data = whitened_rows(posterior, at, -here.residual[:, None])[:, 0]
    return np.concatenate([data, posterior.parameters.has_prior() * z])


def echelon(rows: Float[np.ndarray, "row free"]) -> Float[np.ndarray, "row free"]:
    """Return the reduced row echelon form: it gives combinations of fewest parameters.

    Rows have a length of about 1; entries that are rounding are set to zero.
    """
    rows = np.array(rows, float)
    lead = 0
    for column in range(rows.shape[1]):
        if lead == len(rows):
            break
        # partial pivoting: rounding is not divided by a small entry
        best = lead + int(np.argmax(np.abs(rows[lead:, column])))
        if np.abs(rows[best, column]) <= TAKES_PART:
            continue
        rows[[lead, best]] = rows[[best, lead]]
        rows[lead] /= rows[lead, column]
        for other in range(len(rows)):
            if other != lead:
                rows[other] -= rows[other, column] * rows[lead]
        lead += 1
    sizes = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    rows[np.abs(rows) < TAKES_PART * sizes] = 0.0
    return rows


def _led_by_one(rows: Float[np.ndarray, "row free"]) -> Float[np.ndarray, "row free"]:
    """Scale each row so that its first entry is 1."""
    return np.array([row / row[np.flatnonzero(row)[0]] for row in rows]).reshape(
        rows.shape
    )


def estimable_forms(found: Identifiability) -> Float[np.ndarray, "form free"]:
    """Return the estimable combinations of parameters not identified singly.

    Each row is a linear form in the coordinates that vanishes along every null
    direction. Identified parameters have no component in it.
    """
    open_ones = [i for i, known in enumerate(found.determined) if not known]
    if not open_ones:
        return np.zeros((0, len(found.determined)))
    # Forms of the unidentified parameters that vanish along the null directions. The
    # last parameter leads, so that speeds and times are in terms of the mass. They are
    # scaled, so that metres and seconds have equal weight.
    size = np.abs(found.null).max(axis=0)[open_ones]
    null = found.null[:, open_ones] / size
    forms = np.linalg.svd(null)[2][len(null) :]  # orthogonal complement of the rows
    estimable = np.zeros((len(forms), len(found.determined)))
    estimable[:, open_ones] = _led_by_one(echelon(forms[:, ::-1]) / size[::-1])[:, ::-1]
    return estimable


@dataclass(frozen=True)
class ResolvingDatum:
    """A datum that would resolve a null direction or an ambiguity.

    Attributes:
        quantity: Quantity to record.
        where: "sensor" (at one of the log), "place" (a new one), "aside" (a new place
            off the sensors' line), "range" (a new one) or "later" (at a later time).
        on_right_clock: True if it needs a synchronised clock.
        is_bang: True if it gives the range by the delay after a flash in the log.
    """

    quantity: str
    where: Where
    on_right_clock: bool = False
    is_bang: bool = False


def candidates(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> tuple[Layout, list[ResolvingDatum]]:
    """Return rows that could be added to a log, and their descriptions.

    The rows are each quantity at a sensor of the log, and at a position off the
    sensors' line. That position is no nearer to the sensors than the nearest is to the
    charge.
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
        # with ranges instead of positions a second distance is the only new place
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
    """Return a position off the sensors' line, one layout size from their middle.

    Args:
        posterior: Posterior with the layout.
        reach: Smallest distance from the middle [m].
    """
    position = np.asarray(posterior.layout.position)
    middle, size = position.mean(axis=0), max(float(layout_size(posterior)), reach)
    # the last axis is across the line, or any direction for a single sensor
    _, _, axes = np.linalg.svd((position - middle)[:, :2], full_matrices=True)
    return middle + size * np.array([*axes[-1], 0.0])


@dataclass(frozen=True)
class Cure:
    """Remedies of a null direction, each sufficient alone.

    Attributes:
        parameters: Parameters of which one needs a prior or a measurement.
        data: Rows that could be added.
    """

    parameters: tuple[str, ...]
    data: tuple[ResolvingDatum, ...]


def cure_of_null(
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    direction: Float[np.ndarray, " free"],
) -> Cure:
    """Return the data and priors that would resolve a null direction."""
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
    at_sensor = {datum.quantity for datum in data if datum.where == "sensor"}
    data = [
        replace(
            datum,
            on_right_clock=clocks and datum.quantity in CLOCK_TIMES,
            is_bang=is_filmed and datum.quantity == "air_arrival_s",
        )
        for datum in data
        # a new position is omitted if the quantity at a sensor of the log resolves it
        if datum.where == "sensor" or datum.quantity not in at_sensor
    ]
    if GROWTH in taking_part:
        data.append(ResolvingDatum("fireball_radius_m", "later"))
    return Cure(taking_part, tuple(data))


def laws_beside(posterior: Posterior, scene: Scene, layout: Layout) -> dict[str, str]:
    """Return the laws of the log, and the automatic choice for other quantities."""
    return law_names(resolve_laws(scene, layout)) | {
        q: n for q, n in posterior.laws if q in layout.quantities()
    }


@kept
def log_reading(posterior, layout, laws, z) -> Float[Array, " row"]:
    """Readings of a layout in ln, or in units of a typical travel time."""
    scene = posterior.parameters.scene_at(z)
    value = record(scene, layout, laws).value
    # times relative to a travel time: a change of 3 % then means the same for all
    timed = np.isin(layout.quantity, TIMES)
    typical = layout_size(posterior) / STANDARD_SOUND_SPEED
    return to_error_scale(jnp.where(timed, value / typical, value), layout.quantity)


def cure_of_ambiguity(
    posterior: Posterior,
    here: Float[np.ndarray, " free"],
    there: Float[np.ndarray, " free"],
) -> ResolvingDatum:
    """Return the datum that differs most between two solutions."""
    layout, possible = candidates(posterior, here)
    scene = posterior.parameters.scene_at(jnp.asarray(here))
    laws = laws_beside(posterior, scene, layout)
    apart = np.abs(
        log_reading(posterior, layout, laws, jnp.asarray(here))
        - log_reading(posterior, layout, laws, jnp.asarray(there))
    )
    return possible[int(np.nanargmax(apart))]


def combination(
    names: Sequence[str], space: Sequence[str], weights: Float[np.ndarray, " free"]
) -> tuple[str, bool]:
    """Name a linear form in the coordinates.

    Returns:
        The name, and True for a product of powers (every part is in ln).
    """
    parts = [(n, s, w) for n, s, w in zip(names, space, weights, strict=True) if w != 0]
    if all(s == "ln" for _, s, _ in parts):
        return " * ".join(
            name if _short(w) == "1" else f"{name}^{_short(w)}" for name, _, w in parts
        ), True
    terms = [(f"ln({n})" if s == "ln" else n, w) for n, s, w in parts]
    first, *rest = [
        (w < 0, name if _short(abs(w)) == "1" else f"{_short(abs(w))} * {name}")
        for name, w in terms
    ]
    text = ("-" if first[0] else "") + first[1]
    return text + "".join(f" {'-' if neg else '+'} {t}" for neg, t in rest), False


def _short(weight: float) -> str:
    return f"{weight:.4g}"


@dataclass(frozen=True)
class NullDirection:
    """A direction in which parameters change together and no datum changes.

    Attributes:
        parameters: Component of each parameter; in ln for positive ones.
        space: Space of the coordinates: "ln", "linear" or "mixed".
        cure: Remedies.
    """

    parameters: Mapping[str, float]
    space: str
    cure: Cure


@dataclass(frozen=True)
class OtherMode:
    """Another optimum that the data cannot rule out.

    Attributes:
        parameters: Value of every parameter.
        differ: Names of the parameters that differ from the best optimum.
        delta_chi2: Increase of chi squared over the best optimum.
        cure: Datum that would distinguish it from the best.
    """

    parameters: Mapping[str, float]
    differ: tuple[str, ...]
    delta_chi2: float
    cure: ResolvingDatum


@dataclass(frozen=True)
class EstimableCombination:
    """A combination of unidentified numbers that the data do identify.

    Attributes:
        combination: Formula.
        value: Estimate.
        sd: Standard deviation.
        is_local: True if it is estimable near the answer only (a curved invariance).
    """

    combination: str
    value: float
    sd: float
    is_local: bool = False
