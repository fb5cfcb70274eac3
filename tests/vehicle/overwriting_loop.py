"""A loop that overwrites its state, as a kernel of Warp with an adjoint."""

from typing import no_type_check

import warp as wp

STEPS, STEP = 20, 0.02


@wp.kernel
@no_type_check
def grow(start: wp.array[wp.float64], steps: int, end: wp.array[wp.float64]):
    """Advance x' = x^2 by Euler's method."""
    x = start[0]
    for _ in range(steps):
        x = x + wp.float64(0.02) * x * x
    end[0] = x


def by_tape(x: float) -> float:
    """Return the derivative of the end by the start that Warp's tape gives."""
    start = wp.array([x], dtype=wp.float64, device="cpu", requires_grad=True)
    end = wp.zeros(1, dtype=wp.float64, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(grow, dim=1, inputs=[start, STEPS], outputs=[end], device="cpu")
    one = wp.ones(1, dtype=wp.float64, device="cpu")
    tape.backward(grads={end: one})
    assert start.grad is not None
    return float(start.grad.numpy()[0])


def exactly(x: float) -> float:
    """Return it by the product of the steps' own derivatives."""
    slope = 1.0
    for _ in range(STEPS):
        slope *= 1 + 2 * STEP * x
        x += STEP * x * x
    return slope
