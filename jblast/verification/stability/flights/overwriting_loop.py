"""A loop that overwrites its state, as a kernel of Warp with an adjoint: the trap."""

from typing import no_type_check

import warp as wp

import jblast.vehicle.warp  # noqa: F401 - which keeps Warp quiet

STEP = 0.02


@wp.kernel
@no_type_check
def grow(start: wp.array[wp.float64], steps: int, end: wp.array[wp.float64]):
    """Advance x' = x^2 by Euler's method, in a register."""
    x = start[0]
    for _ in range(steps):
        x = x + wp.float64(0.02) * x * x
    end[0] = x


def slope_by_tape(x: float, steps: int) -> float:
    """Return the derivative of the end by the start that Warp's tape gives."""
    start = wp.array([x], dtype=wp.float64, device="cpu", requires_grad=True)
    end = wp.zeros(1, dtype=wp.float64, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(grow, dim=1, inputs=[start, steps], outputs=[end], device="cpu")
    tape.backward(grads={end: wp.ones(1, dtype=wp.float64, device="cpu")})
    assert start.grad is not None
    return float(start.grad.numpy()[0])


def slope_of_steps(x: float, steps: int) -> float:
    """Return it as the product of the steps' own derivatives."""
    slope = 1.0
    for _ in range(steps):
        slope *= 1 + 2 * STEP * x
        x += STEP * x * x
    return slope
