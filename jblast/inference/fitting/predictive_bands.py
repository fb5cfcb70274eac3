"""What the posterior says along a line away from the charge: the bands of a figure."""

from collections.abc import Mapping
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.fitting.result import Band
from jblast.inference.posterior.parameters import Parameters
from jblast.kept_programs import kept
from jblast.observations import Observations
from jblast.quantities import DIRECTIONS, TIMED
from jblast.sensors import Layout, record
from jblast.sensors.layout import components
from jblast.sensors.record import path_to

POINTS = 80


def bands(
    parameters: Parameters,
    z: Float[np.ndarray, " free"],
    draws: Float[np.ndarray, "draw free"],
    observations: Observations,
    sensors: Layout,
    distance: Float[np.ndarray, " row"],
    laws: Mapping[str, str],
) -> tuple[Band, ...]:
    """Return the band of every quantity and charge of a log.

    It goes from half to twice the reach of the readings, through still air: along a
    range alone the wind has no direction. A draw that places the charge elsewhere is
    nearer to some sensors and further from others; at a sensor's range, from the
    answer, it is shown by what that sensor would read. Between them it is nearer by a
    share that runs straight in ln of the range.

    Args:
        parameters: What was fitted.
        z: The answer.
        draws: Coordinates drawn from the posterior.
        observations: The log.
        sensors: Its rows.
        distance: Slant range of each row at the answer [m].
        laws: Name of the law for each quantity.
    """
    answer = []
    answered = parameters.scene_at(jnp.asarray(z))
    shot = sensors.shot
    for quantity, of in dict.fromkeys(zip(observations.quantity, shot, strict=True)):
        rows = np.isin(observations.quantity, quantity) & (np.array(shot) == of)
        if quantity in DIRECTIONS:  # do not depend on the range
            continue
        is_radius = quantity in TIMED
        # times count from the explosion, which clocks may show at any time
        start = float(answered.charges[of].time_s) if is_radius else 0.0
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
            position=jax.device_put(np.tile(np.nan_to_num(first), (POINTS, 1))),
            slant_range=jax.device_put(np.full(POINTS, seen_from) if is_radius else x),
            time=jax.device_put(x if is_radius else nothing),
            group=(0,) * POINTS,
            shot=(of,) * POINTS,
            clock=("",) * POINTS,
        )
        needed = tuple((name, laws[name]) for name, _ in components(quantity))
        near, first_at = np.unique(np.where(rows, distance, 0.0), return_index=True)
        covered = near > 0
        value, valid = _recordings(
            parameters,
            jax.device_put(np.concatenate([z[None, :], draws])),
            layout,
            None if is_radius else sensors.only(first_at[covered]),
            jax.device_put(near[covered]),
            needed,
        )
        q05, q95 = np.quantile(np.asarray(value)[1:], [0.05, 0.95], axis=0)
        answer.append(
            Band(
                quantity=quantity,
                shot=of,
                axis="time_s" if is_radius else "range_m",
                x=x,
                q05=q05,
                answer=np.asarray(value)[0],
                q95=q95,
                valid=np.asarray(valid)[0],
            )
        )
    return tuple(answer)


@kept
def _recordings(parameters, draws, layout, sensors, near, laws):
    """Return what each draw reads along a layout, its sensors at their own ranges."""

    def one(z):
        scene = parameters.scene_at(z)
        if sensors is None:
            recording = record(scene, layout, dict(laws))
            return recording.value, recording.valid
        own = path_to(scene, sensors, scene.charges[layout.shot[0]]).slant_range
        x = layout.slant_range
        further = jnp.interp(jnp.log(x), jnp.log(near), jnp.log(own / near))
        moved = replace(layout, slant_range=x * jnp.exp(further))
        recording = record(scene, moved, dict(laws))
        return recording.value, recording.valid

    return jax.vmap(one)(draws)
