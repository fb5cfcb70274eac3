r"""What the camera's own motion, and light on all of the scene, change in an image.

The change of the logarithm of light from one frame to the next of a scene that stands
still before a camera that moves is, to first order,

$$\Delta L = -(u\,\partial_x L + v\,\partial_y L) + g$$

(Horn and Schunck 1981, eq. 1) with a flow $(u, v)$ that is affine in the place, and a
gain $g$ of the whole scene. The seven numbers are fitted by least squares to changes
clipped at a few times their mean size, as in Huber's estimate: what moves on its own
pulls little on them.
"""

import numpy as np
from jaxtyping import Float

CLIP = 3.0
"""Changes are clipped at so many times their mean size."""
EVERY = 2
"""Of so many rows and columns one is asked for the motion."""
DAMPING = 1e-6
"""Of the normal equations, a share of their trace: a scene without texture has none."""

Image = Float[np.ndarray, "height width"]


class EgoMotion:
    """Takes away what camera and light do to all of an image.

    Attributes:
        shape: Height and width [px].
    """

    def __init__(self, shape: tuple[int, int]):
        """Get ready for images of a shape."""
        self.shape = shape
        height, width = shape
        x = np.linspace(-1.0, 1.0, width, dtype=np.float32)
        y = np.linspace(-1.0, 1.0, height, dtype=np.float32)[:, None]
        self._x, self._y = x, y
        step = EVERY if min(shape) >= 8 * EVERY else 1
        self._some = np.s_[::step, ::step]
        size = np.ones(shape, np.float32)[self._some].shape
        self._few = (np.broadcast_to(v, shape)[self._some] for v in (x, y))
        self._few = tuple(v.ravel() for v in self._few)
        self._rows = np.ones((7, size[0] * size[1]), np.float32)
        self._across, self._down = (np.zeros(shape, np.float32) for _ in range(2))

    def rest(self, before: Image, after: Image) -> Image:
        """Return the change that neither explains.

        Args:
            before: Logarithm of the light.
            after: The same a frame later.
        """
        change, both = after - before, before + after
        across, down = self._across, self._down
        if self.shape[1] > 2:
            np.subtract(both[:, 2:], both[:, :-2], out=across[:, 1:-1])
        if self.shape[0] > 2:
            np.subtract(both[2:], both[:-2], out=down[1:-1])
        rows = self._rows
        for i, gradient in enumerate((across, down)):
            rows[i] = gradient[self._some].ravel()
            for j, place in enumerate(self._few):
                np.multiply(rows[i], place, out=rows[2 + 2 * i + j])
        few = change[self._some].ravel()
        most = CLIP * float(np.abs(few).mean()) + 1e-6
        clipped = np.clip(few, -most, most)
        square = (rows @ rows.T).astype(float)
        square.flat[::8] += DAMPING * np.trace(square) + 1e-9
        found = np.linalg.solve(square, (rows @ clipped).astype(float))
        a, d, ax, ay, dx, dy, gain = (np.float32(v) for v in found)
        change -= gain
        change -= across * ((a + ax * self._x) + ay * self._y)
        change -= down * ((d + dx * self._x) + dy * self._y)
        return change
