"""Some rows of an event camera that sees colour frames over a background."""

import jax
import numpy as np
from jaxtyping import Float, UInt8

from jblast.sensors.camera.events.strip import Strip, widened
from jblast.sensors.camera.image.grey_composite import grey_composite

_composite = jax.jit(grey_composite)


class CompositeStrip(Strip):
    """As `Strip`; a frame is one word of RGBA a pixel.

    Only what has another word than in the frame before the block is composited.
    """

    def __init__(self, *args, background: Float[np.ndarray, "height width"]):
        """Take what `Strip` takes, and the grey light behind these rows."""
        super().__init__(*args)
        self.background = background.ravel()

    def rows_of(self, frames: UInt8[np.ndarray, "frame height width 4"]) -> np.ndarray:
        """Return one word a pixel, a row for each frame; a view where it can be."""
        rows = frames[:, self.rows]
        if rows.strides[-1] != 1:
            rows = np.ascontiguousarray(rows)
        return rows.view(np.uint32).reshape(len(rows), -1)

    def values(self, frame: np.ndarray) -> np.ndarray:
        """Return the grey light of the first frame."""
        self.words = frame.copy()
        return self.composited(frame[None], np.arange(frame.size))[0]

    def loud(self, block: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the pixels that may send events, their values, the last of all."""
        assert self.last is not None
        changed = np.flatnonzero((block != self.words).any(axis=0))
        values = self.composited(block[:, changed], changed)
        last = self.last.copy()
        last[changed] = values[-1]
        self.words = block[-1].copy()
        loud = self.leaves_bounds(values, changed)
        return changed[loud], values[:, loud], last

    def composited(self, words: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Return the grey light of some pixels."""
        if not at.size:
            return np.empty((len(words), 0), self.background.dtype)
        rgba = widened(words)[:, None, :, None].view(np.uint8)
        light = _composite(rgba, widened(self.background[at])[None])
        return np.asarray(light)[:, 0, : len(at)]
