r"""A start without search: ranges from air minus ground arrivals, then one solve.

The air shock comes later than the ground wave by a time $d$ that knows no clock. At a
mass of reference the laws give the range $R$ of each $d$; at another mass they give
$\sqrt{s}\,R$ with the same $s$ for all sensors, nearly. Then, with sensors at $x_i$,
$$|x|^2 - 2 x \cdot x_i + |x_i|^2 = s R_i^2$$
is linear in $x$, $|x|^2$ and $s$: place and mass follow from four sensors or more.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.many.residuals.rows import LaneRows
from jblast.scene import Scene, with_values
from jblast.scene.uncertain import value_of
from jblast.sensors import Layout
from jblast.sensors.record import record

SOUGHT = {"charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s"}
DEGREE = 5
NEAR, FAR = 0.02, 4.0
"""The laws are fitted for ranges between these multiples of the layout's size."""
LARGEST = 1e3
"""$s$ is kept between one over this and this."""


class ClosedForm(NamedTuple):
    r"""What a layout needs for the solve; see the top of this file.

    Attributes:
        late, early: The rows whose difference is $d$, for each sensor.
        square_range: Polynomial of $\ln R^2$ in $\ln d$, highest power first.
        early_time: Polynomial of ln of the earlier travel time in $\ln R^2$.
        exponent: Of $s$ in the mass.
        mass: The mass of reference [kg].
        place: Sensors, in the plane.
        solve: What gives $x$ from $s R_i^2 - |x_i|^2$.
        rest: What of it no $x$ explains.
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
        """Return where to start."""
        d = jnp.stack(
            [
                measured[a] - measured[g]
                for a, g in zip(self.late, self.early, strict=True)
            ]
        )
        ln_d = jnp.log(jnp.maximum(d, 1e-9))
        square = jnp.exp(_polynomial(self.square_range, ln_d))
        rest = self.rest.astype(square.dtype)
        known = np.sum(self.place**2, axis=1).astype(square.dtype)
        s = jnp.ones_like(square[0])
        if "charge_mass_kg" in rows.parameters.names:
            bent = _product(rest, square)
            s = jnp.sum(bent * (rest @ known)[:, None], axis=0)
            s = jnp.clip(s / jnp.sum(bent * bent, axis=0), 1 / LARGEST, LARGEST)
        square = square * s[None, :]
        x = _product(self.solve.astype(square.dtype), square - known[:, None])
        numbers = {
            "charge_mass_kg": self.mass * s ** (1 / self.exponent),
            "charge_east_m": x[0],
            "charge_north_m": x[1],
        }
        away = self.place.astype(square.dtype)[:, :, None] - x[None, :2]
        ln_square = jnp.log(jnp.maximum(jnp.sum(away * away, axis=1), 1e-6))
        travel = jnp.exp(_polynomial(self.early_time, ln_square))
        first = jnp.stack([measured[g] for g in self.early])
        numbers["origin_time_s"] = jnp.mean(first - travel, axis=0)
        beliefs = zip(rows.parameters.names, rows.parameters.beliefs, strict=True)
        return jnp.stack([b.unconstrain(numbers[name]) for name, b in beliefs])


def closed_form(rows: LaneRows) -> ClosedForm | None:
    """Prepare the solve; None where it does not apply.

    It needs one charge at an unknown place in the plane, air and ground arrivals at
    four places or more that do not lie in one line, and nothing unknown besides mass
    and origin time.
    """
    names, layout, scene = rows.parameters.names, rows.layout, rows.parameters.scene
    if not {"charge_east_m", "charge_north_m"} <= set(names) <= SOUGHT or scene.others:
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
    if values[1] < 0.05 * values[0]:
        return None
    size = float(np.linalg.norm(np.ptp(at, axis=0)))
    ranges = size * np.geomspace(NEAR, FAR, 60)
    known = value_of(scene, "charge_mass_kg")
    mass = 1.0 if known is None or not known > 0 else float(known)
    ln_d, ln_early = _travel(rows, scene, ranges, mass)
    ln_square = 2 * np.log(ranges)
    if not (np.isfinite(ln_d).all() and (np.diff(ln_d) > 0).all()):
        return None
    more = np.interp(ln_d, _travel(rows, scene, ranges, 2 * mass)[0], ln_square)
    inverse = np.linalg.pinv(system)
    late, early_rows = np.array(pairs).T
    return ClosedForm(
        late=late,
        early=early_rows,
        square_range=np.polyfit(ln_d, ln_square, DEGREE),
        early_time=np.polyfit(ln_square, ln_early, DEGREE),
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


def _polynomial(coefficients: np.ndarray, x: Array) -> Array:
    total = jnp.full_like(x, coefficients[0])
    for c in coefficients[1:]:
        total = total * x + float(c)
    return total


def _product(matrix: np.ndarray, x: Array) -> Array:
    """Multiply lanes by a small matrix, written out."""
    return jnp.stack(
        [
            sum(
                (float(c) * x[j] for j, c in enumerate(row)),
                start=jnp.zeros_like(x[0]),
            )
            for row in matrix
        ]
    )
