"""How much one row of a log is missed, and the slopes: a program of plain numbers."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jblast.inference.many.residuals.row_groups import RowGroup
from jblast.inference.posterior.parameters import Parameters
from jblast.scene import with_values
from jblast.sensors import Layout
from jblast.sensors.record import record, residuals_of, to_error_scale
from jblast.sensors.simulate import loadings


class RowPrograms(NamedTuple):
    """The same numbers in two ways.

    Attributes:
        each: Slopes to one unknown after another: what does not depend on it drops out
            where the program is taken apart.
        together: Slopes to all unknowns along one more axis: a fifth of the program
            with four unknowns, where it cannot be taken apart.
    """

    each: Callable[..., list[Array]]
    together: Callable[..., list[Array]]


def row_program(
    parameters: Parameters,
    laws: tuple[tuple[str, str], ...],
    part: RowGroup,
    *,
    sd_known: bool,
) -> RowPrograms:
    """Return the programs that rows of one part share.

    Each takes the fitted coordinates, the row's own effects, its place (east, north,
    up), slant range and time, its reading and instrument error; and returns the
    residual in standard deviations, ln of the standard deviation, the slopes of the
    one to each unknown, then those of the other.

    Args:
        parameters: What is fitted.
        laws: Pairs of quantity and law name.
        part: The rows.
        sd_known: Take the size of the errors as known.
    """
    n, slots = len(parameters.names), len(part.slots)

    def miss(here: Layout, reading, error, unknowns):
        beliefs = zip(parameters.names, parameters.beliefs, strict=True)
        numbers = {
            name: belief.constrain(at)
            for (name, belief), at in zip(beliefs, unknowns, strict=False)
        }
        recording = record(with_values(parameters.scene, numbers), here, dict(laws))
        sd = jnp.hypot(error, recording.record_sd[0])
        shared = loadings(recording, here)[0]
        if sd_known:
            sd, shared = jax.lax.stop_gradient((sd, shared))
        predicted = to_error_scale(recording.value, here.quantity)
        rest = residuals_of(reading[None], predicted, here.quantity)[0]
        for j in range(slots):
            rest = rest - shared[j] * unknowns[n + j]
        return rest / sd, jnp.log(sd)

    def split(numbers):
        east, north, up, slant, time, reading, error = numbers[n + slots :]
        layout = Layout(
            quantity=part.layout.quantity,
            position=jnp.stack([east, north, up])[None],
            slant_range=slant[None],
            time=time[None],
            group=(0,),
            shot=part.layout.shot,
            clock=part.layout.clock,
        )
        return list(numbers[: n + slots]), (layout, reading, error)

    def each(*numbers):
        unknowns, row = split(numbers)
        out: list[Any] = list(miss(*row, unknowns))
        slopes = []
        for k, at in enumerate(unknowns):

            def along(x, k=k):
                return miss(*row, [*unknowns[:k], x, *unknowns[k + 1 :]])

            slopes.append(jax.jvp(along, (at,), (jnp.ones_like(at),))[1])
        return [*out, *(s[0] for s in slopes), *(s[1] for s in slopes)]

    def together(*numbers):
        unknowns, row = split(numbers)
        at = jnp.stack(unknowns)

        def along(direction):
            return jax.jvp(lambda x: miss(*row, list(x)), (at,), (direction,))

        axes = jnp.eye(n + slots, dtype=at.dtype)
        out, slopes = jax.vmap(along, out_axes=(None, 0))(axes)
        return [*out, *slopes[0], *slopes[1]]

    return RowPrograms(each, together)
