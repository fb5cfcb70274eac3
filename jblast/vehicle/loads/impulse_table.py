r"""Tabulated impulses of blasts, one case per row, as a pulse on a vehicle.

A case contains the delay of the wave after detonation, the distance of the charge,
its direction as seen from the vehicle, and the effect of the wave: impulses along body
axes and angular impulses about them. The file is a CSV in the format of the custom
profiles of Parab's thesis.

The thesis does not define its axes. Declared here: axial, side and normal are body x, y
and z; the polar angle is from body z, the azimuth from x towards y. With these, the
charges of the sample are at (-5, -5, -5) m and (-10, -10, -10) m, and their impulses
are directed away from them.

Between distances, $J R^2$, $M R^2$ and delay/$R$ are linear in $\ln R$. Beyond the
table they are constant: an inverse square and a steady speed. The cases are those of
the nearest direction. The table has no durations, so an impulse is applied as a
constant force.

**Moments.** The sample's angular impulses are 100.0 m times its impulses across body x:
they refer to a point 100 m behind the vehicle, and as moments about the vehicle they
are 1e4 times too large. With `moment_point_m` they are converted to the vehicle,
$M - r \times J$ with $r$ from that point to the centre of mass: (100, 0, 0) m leaves
(-1.8, 2.4, -0.5) mN m s of the first case. A profile whose moments have lever arms far
beyond the vehicle's size is rejected without `moment_point_m`.
"""

import csv
import math
import os
from collections.abc import Sequence
from contextlib import suppress

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.errors import argument, read_text, require, shown
from jblast.types import as_numbers
from jblast.vehicle.quadrotor import Vehicle
from jblast.vehicle.state import (
    State,
    four,
    rotation,
    three,
    times,
    times_transposed,
    unit,
)

DURATION_S = 1e-3
"""Duration over which an impulse is applied: that of the thesis."""
SOLE_DIRECTION_RAD = 0.1
"""Angle up to which a single case counts as in range, 6 degrees; declared.

A table of several directions has their spacing instead. The angle affects `in_range`
only, not the interpolation.
"""
ANY = -math.inf, math.inf
COLUMNS = {
    "Time Delay (s)": (0.0, math.inf),
    "Distance (m)": (1e-3, math.inf),  # the least of a flight, too
    "View Polar Angle (Deg.)": (0.0, 180.0),
    "View Azimuthal Angle (Deg.)": (-360.0, 360.0),
    **dict.fromkeys(("FA (N*s)", "FS (N*s)", "FN (N*s)"), ANY),
    **dict.fromkeys(("Ml (N*m*s)", "Mm (N*m*s)", "Mn (N*m*s)"), ANY),
}
"""Columns of the file, in any order, and the least and largest number of each; others
(as Case Number) are ignored."""
MAX_LEVER_SIZES = 3.0
"""Maximum lever of an impulse, in distances from the centre of mass to the farthest
rotor.

An impulse acts on the vehicle itself, so its lever is at most about 1; 3 leaves room
for protruding parts. The sample's levers about the wrong point are above 400.
"""


class CustomProfile(eqx.Module):
    """Pulse interpolated between tabulated cases.

    Attributes:
        direction: Unit vectors towards the charge, body axes.
        cases: Cases of each direction by distance $R$: ln of it [m], $J R^2$ and
            $M R^2$, body axes [N s m2, N m s m2], and delay over $R$ [s/m].
        spacing_rad: Angle up to which a direction counts as in range.
        charge_m: Position of the charge: east, north, up.
        time_s: Time of its detonation; infinite: it never happens.
    """

    direction: Float[Array, "way 3"] = eqx.field(converter=as_numbers)
    cases: Float[Array, "way case 8"] = eqx.field(converter=as_numbers)
    spacing_rad: Float[Array, ""] = eqx.field(converter=as_numbers)
    charge_m: Float[Array, "3"] = eqx.field(converter=as_numbers)
    time_s: Float[Array, ""] = eqx.field(converter=as_numbers)

    def impulse_at(
        self, position_m: Float[Array, "3"], quaternion: Float[Array, "4"]
    ) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, ""]]:
        """Return impulse and angular impulse, body axes, and the delay [s]."""
        distance, cases, _ = self._seen(position_m, quaternion)
        interpolated = jax.vmap(jnp.interp, (None, None, 1))
        found = interpolated(jnp.log(distance), cases[:, 0], cases[:, 1:])
        square = jnp.square(distance)
        return found[:3] / square, found[3:6] / square, found[6] * distance

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return the impulse on a vehicle between two times.

        Returns:
            Impulse, world [N s], and angular impulse, body [N m s].
        """
        push, turn, delay = self.impulse_at(state.position_m, state.quaternion)
        attitude = rotation(unit(four(state.quaternion)))
        world = jnp.stack(times(attitude, three(push)))
        step = end_s - start_s
        never = jnp.isposinf(self.time_s)
        # An infinite time would give NaN gradients, although it is masked below.
        time_s = jnp.where(never, end_s, self.time_s)
        first = (start_s - time_s - delay) / DURATION_S

        def share(place: Float[Array, "3"]) -> Float[Array, ""]:
            later = self.impulse_at(place, state.quaternion)[2]
            last = (end_s - time_s - later) / DURATION_S
            return jnp.clip(last, 0, 1) - jnp.clip(first, 0, 1)

        ahead = state.position_m + state.velocity_m_s * step
        # A vehicle pushed away receives a smaller share of the pulse within this step.
        # The remainder follows in the next step, so the total is complete.
        pushed = share(ahead) * world * step / (2 * vehicle.mass_kg)
        given = jnp.where(never, 0.0, share(ahead + pushed))
        return world * given, turn * given

    def in_range(
        self, position_m: Float[Array, "3"], quaternion: Float[Array, "4"]
    ) -> Bool[Array, ""]:
        """Return whether the nearest direction and its distances cover a position.

        A direction counts as covered up to the spacing of the table's directions.
        """
        distance, cases, apart = self._seen(position_m, quaternion)
        slack = 1e-6  # rounding of a position in float32
        low, along, high = cases[0, 0] - slack, jnp.log(distance), cases[-1, 0] + slack
        return (low <= along) & (along <= high) & (apart <= self.spacing_rad)

    def _seen(
        self, position_m: Float[Array, "3"], quaternion: Float[Array, "4"]
    ) -> tuple[Float[Array, ""], Float[Array, "case 8"], Float[Array, ""]]:
        """Return distance, cases of the nearest direction, and the angle to it [rad].

        Cases of directions that are equally near are averaged.
        """
        toward = self.charge_m - position_m
        # 1 mm at least, so that the direction is finite at the charge itself.
        distance = jnp.sqrt(jnp.maximum(jnp.sum(jnp.square(toward)), 1e-6))
        attitude = rotation(unit(four(quaternion)))
        seen = jnp.stack(times_transposed(attitude, three(toward / distance)))
        cosine = self.direction @ seen
        nearest = (cosine >= jnp.max(cosine)).astype(cosine.dtype)
        angle = jnp.arccos(jnp.clip(jnp.max(cosine), -1, 1))
        cases = jnp.tensordot(nearest / jnp.sum(nearest), self.cases, 1)
        return distance, cases, angle


def custom_profile(
    cases: Float[np.ndarray, "case 10"],
    *,
    moment_point_m: Sequence[float] | None = None,
    vehicle: Vehicle | None = None,
) -> CustomProfile:
    """Return the pulse of tabulated cases, of a charge at the origin at 0 s.

    Args:
        cases: Table as returned by `read_custom_profile`: delay [s], distance [m],
            polar and azimuthal angle [rad], impulses x, y, z [N s], angular impulses
            [N m s].
        moment_point_m: Vector from the reference point of the moments to the vehicle's
            centre of mass, body axes [m]; None: they refer to the centre of mass.
        vehicle: Vehicle whose size limits the levers if there is no reference point;
            None: no check.

    Raises:
        InputError: The point does not have three numbers, or a lever is too long.
    """
    if moment_point_m is None and vehicle is not None:
        check_levers(cases, vehicle)
    arm = (0.0, 0.0, 0.0) if moment_point_m is None else moment_point_m
    require(np.shape(arm) == (3,), "moment_point_m", "3 numbers [m]", np.shape(arm))
    delay, distance, polar, azimuth = cases[:, :4].T
    push = cases[:, 4:7]
    # About the centre of mass: M_c = M_p - r x J, with r from the point to it.
    turn = cases[:, 7:] - np.cross(arm, push)
    level = np.array([np.cos(azimuth), np.sin(azimuth)]) * np.sin(polar)
    toward = np.stack([*level, np.cos(polar)], axis=1)
    # Rounded, so that equal directions of a file in degrees compare equal in radians.
    _, first, way = np.unique(
        np.round(toward, 9), axis=0, return_index=True, return_inverse=True
    )
    order = [np.flatnonzero(way.ravel() == n) for n in range(len(first))]
    order = [places[np.argsort(distance[places])] for places in order]
    most = max(map(len, order))
    # Directions of fewer cases repeat their last one.
    table = np.array([np.pad(o, (0, most - len(o)), mode="edge") for o in order])
    # An impulse falls about as 1/R^2: times R^2 it is flat between two cases.
    columns = np.concatenate([push.T, turn.T]) * np.square(distance)
    rows = np.stack([np.log(distance), *columns, delay / distance], axis=1)
    return CustomProfile(
        direction=toward[first],
        cases=rows[table],
        spacing_rad=_spacing(toward[first]),
        charge_m=np.zeros(3),
        time_s=0.0,
    )


def _spacing(toward: np.ndarray) -> float:
    """Return the largest angle between a direction and its nearest neighbour [rad]."""
    if len(toward) == 1:
        return SOLE_DIRECTION_RAD
    angle = np.arccos(np.clip(toward @ toward.T, -1, 1))
    # A direction is not its own neighbour.
    np.fill_diagonal(angle, np.inf)
    return float(angle.min(axis=1).max())


def read_custom_profile(path: str | os.PathLike[str]) -> Float[np.ndarray, "case 10"]:
    """Read the cases of a custom profile.

    Returns:
        Columns: delay [s], distance [m], polar and azimuthal angle [rad], impulses
        along body x, y, z [N s], angular impulses about them [N m s].

    Raises:
        InputError: The file is empty, a column is missing, or a field is no finite
            number within its range; the message names file, line and column.
    """
    lines = read_text(path, "a CSV file of blast impulses").splitlines()
    table = csv.DictReader(lines, skipinitialspace=True)
    heads = list(table.fieldnames or [])
    table.fieldnames = [_plain(name) for name in heads]
    missing = [name for name in COLUMNS if _plain(name) not in table.fieldnames]
    at, got = f"{path}: line {table.line_num}", ", ".join(heads) or "an empty file"
    require(not missing, at, f"the columns {', '.join(missing)}", got)
    cases: dict[tuple[float, ...], list[float]] = {}
    for row in table:
        at = f"{path}: line {table.line_num}"
        # The reader's mark of a surplus or a missing field.
        whole = None not in row and None not in row.values()
        require(whole, at, f"{len(heads)} fields")
        case = []
        for name, (low, high) in COLUMNS.items():
            text, value = row[_plain(name)].strip(), math.nan
            with suppress(ValueError):
                # Python reads 1_000, which is a mistake in data.
                value = float(text.replace("_", "?"))
            fits = math.isfinite(value) and low <= value <= high
            words = f"a finite number from {low:g} to {high:g}"
            got = shown(text) if text else "nothing"
            require(fits, f"{at}, column {name}", words, got)
            case.append(value)
        place = tuple(case[1:4])
        words, got = "a new distance or direction", "that of an earlier line"
        require(place not in cases, at, words, got)
        cases[place] = case
    require(cases, path, "one case per row", "only a header")
    found = np.array([*cases.values()])
    found[:, 2:4] = np.radians(found[:, 2:4])
    return found


def _plain(name: str) -> str:
    return "".join(name.lower().split())


def check_levers(cases: Float[np.ndarray, "case 10"], vehicle: Vehicle) -> None:
    """Reject moments that cannot refer to a vehicle's centre of mass.

    Args:
        cases: Table as returned by `read_custom_profile`.
        vehicle: The vehicle.

    Raises:
        InputError: The lever of a case, moment over impulse, exceeds `MAX_LEVER_SIZES`
            times the distance of the rotors.
    """
    arms = np.linalg.norm(np.asarray(vehicle.rotor_position_m, float), axis=-1)
    longest = MAX_LEVER_SIZES * float(arms.max())
    push, turn = (np.linalg.norm(cases[:, a:b], axis=1) for a, b in ((4, 7), (7, 10)))
    # A moment of zero has no lever.
    with np.errstate(divide="ignore", invalid="ignore"):
        levers = np.where(turn > 0, turn / push, 0.0)
    worst = int(np.argmax(levers))
    require(
        levers[worst] <= longest,
        f"profile: case {worst + 1} of {len(cases)}",
        f"a lever (moment over impulse) of at most {longest:.2g} m, "
        f"{MAX_LEVER_SIZES:g} times the distance from the vehicle's centre to its "
        f"rotors; for moments about another point {argument('moment_point_m')}, the "
        "vector from that point to the centre of mass, body axes (0,0,0 if the moments "
        "do refer to the centre of mass)",
        f"one of {levers[worst]:.3g} m",
    )
