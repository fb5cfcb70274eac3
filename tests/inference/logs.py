"""Logs made by hand for the tests of inference."""

import numpy as np

from jblast.observations import Observations


def log(*rows: tuple, at_range: bool = False) -> Observations:
    """Make a log of rows (sensor, quantity, value, sigma, place).

    A place is (east, north, up) or, where `at_range`, a slant range. A sigma of None
    leaves the law's scatter alone.
    """
    n = len(rows)
    nothing = np.full(n, np.nan)
    places = [place for *_, place in rows]
    return Observations(
        sensor=tuple(row[0] for row in rows),
        quantity=tuple(row[1] for row in rows),
        value=np.array([row[2] for row in rows], float),
        sigma=np.array([np.nan if row[3] is None else row[3] for row in rows], float),
        position=np.full((n, 3), np.nan) if at_range else np.array(places, float),
        slant_range=np.array(places, float) if at_range else nothing,
        time=nothing,
        path=("",) * n,
        shot=("",) * n,
        clock=("",) * n,
    )
