"""What the posterior says along a line away from the charge: the bands of a figure."""

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.fit_result import Band
from jblast.inference.parameters import Parameters
from jblast.kept_programs import kept
from jblast.observations import Observations
from jblast.quantities import DIRECTIONS, TIMED
from jblast.sensors import Layout, record
from jblast.sensors.layout import components

POINTS = 80


def bands(
    parameters: Parameters,
    draws: Float[np.ndarray, "draw free"],
    observations: Observations,
    distance: Float[np.ndarray, " row"],
    shot: Sequence[int],
    laws: Mapping[str, str],
) -> tuple[Band, ...]:
    """Return the band of every quantity and charge of a log.

    It goes from half to twice the reach of the readings, through still air: along a
    range alone the wind has no direction.

    Args:
        parameters: What was fitted.
        draws: Coordinates drawn from the posterior.
        observations: The log.
        distance: Slant range of each row at the answer [m].
        shot: Which of the scene's charges each row is of.
        laws: Name of the law for each quantity.
    """
    answer = []
    middle = parameters.scene_at(jnp.median(jnp.asarray(draws), axis=0))
    for quantity, of in dict.fromkeys(zip(observations.quantity, shot, strict=True)):
        rows = np.isin(observations.quantity, quantity) & (np.array(shot) == of)
        if quantity in DIRECTIONS:  # do not depend on the range
            continue
        is_radius = quantity in TIMED
        # times count from the explosion, which clocks may show at any time
        start = float(middle.charges[of].time) if is_radius else 0.0
        reach = (observations.time - start if is_radius else distance)[rows]
        positive = reach[reach > 0]
        if positive.size == 0:
            continue
        x = start + np.geomspace(positive.min() / 2, positive.max() * 2, POINTS)
        nothing = np.full(POINTS, np.nan)
        one = int(np.flatnonzero(rows)[0])
        first, seen_from = observations.position[one], observations.slant_range[one]
        layout = Layout(
            quantity=(quantity,) * POINTS,
            # of radii: where they are seen from
            position=jnp.broadcast_to(np.nan_to_num(first), (POINTS, 3)),
            slant_range=jnp.broadcast_to(seen_from, POINTS)
            if is_radius
            else jnp.asarray(x),
            time=jnp.asarray(x if is_radius else nothing),
            group=(0,) * POINTS,
            shot=(of,) * POINTS,
            clock=("",) * POINTS,
        )
        needed = tuple((name, laws[name]) for name, _ in components(quantity))
        value, valid = _recordings(parameters, jnp.asarray(draws), layout, needed)
        q05, q50, q95 = np.quantile(np.asarray(value), [0.05, 0.5, 0.95], axis=0)
        answer.append(
            Band(
                quantity=quantity,
                shot=of,
                axis="time_s" if is_radius else "range_m",
                x=x,
                q05=q05,
                q50=q50,
                q95=q95,
                valid=np.mean(np.asarray(valid), axis=0) > 0.5,
            )
        )
    return tuple(answer)


@kept
def _recordings(parameters, draws, layout, laws):
    def one(z):
        recording = record(parameters.scene_at(z), layout, dict(laws))
        return recording.value, recording.valid

    return jax.vmap(one)(draws)
