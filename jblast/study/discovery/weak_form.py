r"""Equations of motion without derivatives: integrals over short windows.

A window $\varphi$ of half width $H$ around $t_k$ is $(1 - s^2)^4$ with
$s = (t - t_k)/H$, and zero outside. By parts,
$$-\int \varphi' x\, dt = \sum_j c_j \int \varphi\, \theta_j(x, u)\, dt$$
so that noise in $x$ is averaged, where a difference quotient would enlarge it
(Messenger and Bortz 2021, Multiscale Model. Simul. 19:1474, eq. 2.3).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import sparse

POWER = 4
r"""Of a window; $\varphi$ and three derivatives vanish at its ends."""
PER_HALF_WIDTH = 4
"""Windows in each half width of one: closer ones say the same again."""
MOST = 600
"""Windows at most."""
FEWEST_ROWS = 4
"""Rows in a half width, on average; fewer do not tell a window's shape."""
PIECES = 4
"""Pieces of quadrature in a half width, at least: a gap between rows may be wider."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)


class Windows(NamedTuple):
    r"""Integrals over windows, as matrices.

    Attributes:
        time: Places of quadrature, at least three between two rows.
        integral: $\int \varphi f$ of what is known at the places.
        derivative: $-\int \varphi' f$ of what is known at the places.
        of_rows: $-\int \varphi' f$ of what is known at the rows, linear between them.
        centre: Of each window.
        half: Half width of all.
    """

    time: Float[np.ndarray, " place"]
    integral: sparse.csr_array
    derivative: sparse.csr_array
    of_rows: sparse.csr_array
    centre: Float[np.ndarray, " window"]
    half: float


def half_width(
    time: Float[np.ndarray, " row"],
    value: Float[np.ndarray, "row state"],
    slope: Float[np.ndarray, "row state"],
) -> float:
    """Return the half width that the fastest state asks for.

    It is the state's standard deviation over that of its derivative: 1/6 of the period
    of an oscillation. At least four rows lie in it, and it is an eighth of the record
    at most.
    """
    length = float(time[-1] - time[0])
    own = float(np.min(np.std(value, axis=0) / np.sqrt(np.mean(slope**2, axis=0))))
    fewest = FEWEST_ROWS * length / (len(time) - 1)
    return min(max(own, fewest), length / 8.0)


def windows(time: Float[np.ndarray, " row"], half: float) -> Windows:
    """Return the integrals over windows spread evenly over a record.

    Args:
        time: Of the rows, rising.
        half: Half width of a window, in the unit of the times.
    """
    span = time[-1] - time[0] - 2.0 * half
    count = min(MOST, 1 + int(np.ceil(PER_HALF_WIDTH * span / half)))
    places, weights = _quadrature(time, half / PIECES)
    centres = np.linspace(time[0] + half, time[-1] - half, count)
    first = np.searchsorted(places, centres - half)
    last = np.searchsorted(places, centres + half)
    row = np.repeat(np.arange(count), last - first)
    column = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)])
    offset = (places[column] - centres[row]) / half
    bell = 1.0 - offset**2
    shape = (count, len(places))

    def matrix(values: Float[np.ndarray, " entry"]) -> sparse.csr_array:
        return sparse.csr_array((values * weights[column], (row, column)), shape)

    integral = matrix(bell**POWER)
    derivative = matrix(2.0 * POWER / half * offset * bell ** (POWER - 1))
    of_rows = derivative @ _between(time, places)
    return Windows(places, integral, derivative, of_rows, centres, half)


def _quadrature(
    time: Float[np.ndarray, " row"], longest: float
) -> tuple[Float[np.ndarray, " place"], Float[np.ndarray, " place"]]:
    """Return places and weights; no piece is longer than said, none crosses a row."""
    gaps = np.diff(time)
    pieces = np.maximum(1, np.ceil(gaps / longest)).astype(int)
    length = np.repeat(gaps / pieces, pieces)
    nth = np.arange(len(length)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    start = np.repeat(time[:-1], pieces) + nth * length
    places = start[:, None] + 0.5 * length[:, None] * (NODES + 1.0)
    return places.ravel(), (0.5 * length[:, None] * WEIGHTS).ravel()


def _between(
    time: Float[np.ndarray, " row"], places: Float[np.ndarray, " place"]
) -> sparse.csr_array:
    """Return what takes values at the rows to the places, linearly between rows."""
    left = np.searchsorted(time, places, side="right") - 1
    share = (places - time[left]) / (time[left + 1] - time[left])
    place = np.arange(len(places))
    values = np.concatenate([1.0 - share, share])
    return sparse.csr_array(
        (values, (np.tile(place, 2), np.concatenate([left, left + 1]))),
        (len(places), len(time)),
    )
