r"""Starting points of a batch of fits: given, in closed form, or drawn from the prior.

Closed form: the air shock arrives later than the ground wave by a time $d$ that does
not depend on any clock. At a reference mass the laws give the range $R$ of each $d$; at
another mass they give $\sqrt{s}\,R$, with nearly the same $s$ for all sensors. Then,
with sensors at $x_i$,
$$|x|^2 - 2 x \cdot x_i + |x_i|^2 = s R_i^2$$
is linear in $x$, $|x|^2$ and $s$: position and mass follow from four sensors or more.

Draws of the prior: the layout is the same for all logs, so a reference set of points is
drawn once (`posterior.starts`) and its readings are predicted. A log starts from the
points whose readings are nearest to its own, in standard deviations. A free origin time
is left out of the comparison, and set to make the log's mean lateness zero.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.errors import InputError
from jblast.inference.many.residuals import LaneRows
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.posterior.starts import starts
from jblast.observations import CLOCK_TIMES
from jblast.scene import Free, Scene, with_values
from jblast.scene.uncertain import value_of
from jblast.sensors import Layout
from jblast.sensors.forward_model import record

Z = Float[Array, "free lane"]
# the numbers that the closed form determines: others have to be fixed
CLOSED_FORM = {"charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s"}
# of the polynomials over two decades of range: a start needs no better fit
DEGREE = 5
MIN_RANGE, MAX_RANGE = 0.02, 4.0
"""Ranges for which the laws are fitted, relative to the size of the layout."""
MAX_SCALE = 1e3
"""Largest $s$, and one over the smallest: wrong readings may give any number."""
REFERENCE_DRAWS = 64
"""Size of the reference set, as many as `fit` has starts."""
BATCH = 4096
"""Logs that are compared with it together: their arrays stay in a cache."""


class ReferenceSet(NamedTuple):
    """Places with their predicted readings.

    Attributes:
        z: Coordinates of the places.
        projected: Readings in standard deviations, projected onto the complement of an
            origin time.
        half_square: Half of their squared length.
        weight: Matrix of this projection for the readings of a log.
        late: Weights of the mean lateness of a log's readings.
        late_of_place: Mean lateness of each place.
        clock: 1 for the coordinate of the origin time.
    """

    z: Float[Array, "place free"]
    projected: Float[Array, "row place"]
    half_square: Float[Array, " place"]
    weight: Float[Array, "row row"]
    late: Float[Array, " row"]
    late_of_place: Float[Array, " place"]
    clock: Float[Array, " free"]


def reference_set(
    key: PRNGKeyArray,
    posterior: Posterior,
    rows: LaneRows,
    sigma: Float[np.ndarray, " row"],
    count: int = REFERENCE_DRAWS,
) -> ReferenceSet:
    """Draw a reference set.

    Args:
        key: Random key.
        posterior: Posterior of any log of the layout.
        rows: Rows of the layout.
        sigma: Instrument errors of a typical log.
        count: Number of places.
    """
    z = starts(key, posterior, count)
    misfit = jax.vmap(posterior.misfit)(z)
    scale = np.hypot(sigma, np.median(np.asarray(misfit.sd), axis=0))
    readings = rows.to_error_scale(misfit.predicted)
    good = np.isfinite(np.asarray(readings)).all(axis=0)
    z, readings = z[good], readings[:, good]
    timed = np.isin(rows.layout.quantity, CLOCK_TIMES)
    clock = [
        name == "origin_time_s" and isinstance(belief, Free)
        for name, belief in zip(
            rows.parameters.names, rows.parameters.beliefs, strict=True
        )
    ]
    late = timed / scale**2
    late = late / late.sum() if any(clock) and timed.any() else 0 * late
    weight = (np.eye(scale.size) - timed[:, None] * late[None, :]) / scale[:, None]
    projected = weight @ np.asarray(readings)
    # uncommitted to a device: lanes may be on another one
    return ReferenceSet(
        *map(
            jnp.asarray,
            (
                np.asarray(z),
                projected,
                0.5 * np.sum(projected**2, axis=0),
                weight,
                late,
                late @ np.asarray(readings),
                np.array(clock, float),
            ),
        ),
    )


@functools.partial(jax.jit, static_argnums=2)
def nearest(
    references: ReferenceSet, measured: Float[Array, "row lane"], skipped: int
) -> Z:
    """Return the nearest places to logs, after `skipped` nearer ones."""

    def of_log(log: Float[Array, " row"]):
        # half the squared distance, without the square of the log's own readings
        away = references.half_square - (references.weight @ log) @ references.projected
        for _ in range(skipped):
            away = away.at[jnp.argmin(away)].set(jnp.inf)
        best = jnp.argmin(away)
        late = references.late @ log - references.late_of_place[best]
        return references.z[best] + references.clock * late

    return jax.lax.map(of_log, measured.T, batch_size=BATCH).T


def given_starts(starts, logs: int, free: int) -> Float[Array, "try free log"]:
    """Return starts in the form of the engine.

    Raises:
        InputError: Their shape is not (log, free) or (try, log, free).
    """
    starts = jnp.asarray(starts)
    if starts.shape[-2:] != (logs, free) or starts.ndim not in (2, 3):
        raise InputError(
            f"starts: expected ({logs}, {free}), or as many for each try, "
            f"got {starts.shape}"
        )
    return jnp.moveaxis(starts.reshape(-1, logs, free), 2, 1)


class ClosedForm(NamedTuple):
    r"""Coefficients of the closed form for a layout; see the top of this file.

    Attributes:
        late, early: Rows whose difference is $d$, for each sensor.
        square_range: Polynomial of $\ln R^2$ in $\ln d$, highest power first.
        early_time: Polynomial of ln of the earlier travel time in $\ln R^2$.
        exponent: Exponent of the mass in $s$.
        mass: Reference mass [kg].
        place: Positions of the sensors in the plane.
        solve: Matrix that gives $x$ from $s R_i^2 - |x_i|^2$.
        rest: Projection onto the part that no $x$ explains.
    """

    late: np.ndarray
    early: np.ndarray
    square_range: np.ndarray
    early_time: np.ndarray
    exponent: float
    mass: float
    place: np.ndarray
    solve: np.ndarray
    rest: np.ndarray

    def start(
        self, rows: LaneRows, measured: Float[Array, "row lane"]
    ) -> Float[Array, "free lane"]:
        """Return the starts of logs by their readings."""
        d = jnp.stack(
            [
                measured[a] - measured[g]
                for a, g in zip(self.late, self.early, strict=True)
            ]
        )
        ln_d = jnp.log(jnp.maximum(d, 1e-9))
        square = jnp.exp(jnp.polyval(self.square_range.astype(d.dtype), ln_d))
        rest = self.rest.astype(square.dtype)
        known = np.sum(self.place**2, axis=1).astype(square.dtype)
        s = jnp.ones_like(square[0])
        if "charge_mass_kg" in rows.parameters.names:
            # s minimises the part that no position explains, |P (s R^2 - |x|^2)|^2
            bent = _product(rest, square)
            s = jnp.sum(bent * (rest @ known)[:, None], axis=0)
            s = jnp.clip(s / jnp.sum(bent * bent, axis=0), 1 / MAX_SCALE, MAX_SCALE)
        square = square * s[None, :]
        x = _product(self.solve.astype(square.dtype), square - known[:, None])
        numbers = {
            "charge_mass_kg": self.mass * s ** (1 / self.exponent),
            "charge_east_m": x[0],
            "charge_north_m": x[1],
        }
        away = self.place.astype(square.dtype)[:, :, None] - x[None, :2]
        ln_square = jnp.log(jnp.maximum(jnp.sum(away * away, axis=1), 1e-6))
        travel = jnp.exp(jnp.polyval(self.early_time.astype(d.dtype), ln_square))
        first = jnp.stack([measured[g] for g in self.early])
        numbers["origin_time_s"] = jnp.mean(first - travel, axis=0)
        beliefs = zip(rows.parameters.names, rows.parameters.beliefs, strict=True)
        return jnp.stack([b.unconstrain(numbers[name]) for name, b in beliefs])


def closed_form(rows: LaneRows) -> ClosedForm | None:
    """Return the closed form of a layout; None if it does not apply.

    It needs one charge at an unknown position in the plane, air and ground arrivals at
    four positions or more that are not in one line, and no further unknowns but mass
    and origin time.
    """
    names, layout, scene = rows.parameters.names, rows.layout, rows.parameters.scene
    if (
        not {"charge_east_m", "charge_north_m"} <= set(names) <= CLOSED_FORM
        or len(scene.charges) > 1
    ):
        return None
    if np.isfinite(np.asarray(layout.slant_range)).any():
        return None
    place = np.asarray(layout.position)
    early = {
        place[row].tobytes(): row
        for row, quantity in enumerate(layout.quantity)
        if quantity == "ground_arrival_s"
    }
    pairs = [
        (row, early[place[row].tobytes()])
        for row, quantity in enumerate(layout.quantity)
        if quantity == "air_arrival_s" and place[row].tobytes() in early
    ]
    if len(pairs) < 4:
        return None
    at = place[[late for late, _ in pairs]][:, :2]
    system = np.column_stack([-2 * at, np.ones(len(at))])
    values = np.linalg.svd(at - at.mean(axis=0))[1]
    # nearly in one line the position across it would have no precision
    if values[1] < 0.05 * values[0]:
        return None
    size = float(np.linalg.norm(np.ptp(at, axis=0)))
    ranges = size * np.geomspace(MIN_RANGE, MAX_RANGE, 60)
    known = value_of(scene, "charge_mass_kg")
    mass = 1.0 if known is None or not known > 0 else float(known)
    ln_d, ln_early = _travel(rows, scene, ranges, mass)
    ln_square = 2 * np.log(ranges)
    if not (np.isfinite(ln_d).all() and (np.diff(ln_d) > 0).all()):
        return None
    # the range at twice the mass for the same d gives the exponent of s in the mass
    more = np.interp(ln_d, _travel(rows, scene, ranges, 2 * mass)[0], ln_square)
    inverse = np.linalg.pinv(system)
    late, early_rows = np.array(pairs).T
    return ClosedForm(
        late=late,
        early=early_rows,
        square_range=np.polyfit(ln_d, ln_square, DEGREE),
        early_time=np.polyfit(ln_square, ln_early, DEGREE),
        # in the middle of the ranges, away from both ends
        exponent=float(np.mean((more - ln_square)[20:40]) / np.log(2)),
        mass=mass,
        place=at,
        solve=inverse[:2],
        rest=np.eye(len(at)) - system @ inverse,
    )


def _travel(rows: LaneRows, scene: Scene, ranges: np.ndarray, mass: float):
    """Return ln of air minus ground, and ln of ground, travel times by range."""
    numbers = {"charge_mass_kg": mass, "charge_east_m": 0.0, "charge_north_m": 0.0}
    scene = with_values(scene, numbers | {"origin_time_s": 0.0})
    n = ranges.size
    place = np.zeros((n, 3))
    place[:, 0] = ranges

    def times(quantity: str) -> np.ndarray:
        layout = Layout(
            quantity=(quantity,) * n,
            position=jnp.asarray(place),
            slant_range=jnp.full(n, jnp.nan),
            time=jnp.full(n, jnp.nan),
            group=(0,) * n,
            shot=(0,) * n,
            clock=("",) * n,
        )
        value = jax.jit(lambda s: record(s, layout, dict(rows.laws)).value)(scene)
        return np.asarray(value)

    air, ground = times("air_arrival_s"), times("ground_arrival_s")
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.log(air - ground), np.log(ground)


def _product(matrix: np.ndarray, x: Array) -> Array:
    """Multiply lanes by a small matrix, written out so that XLA can fuse it."""
    return jnp.stack(
        [
            sum(
                (float(c) * x[j] for j, c in enumerate(row)),
                start=jnp.zeros_like(x[0]),
            )
            for row in matrix
        ]
    )
