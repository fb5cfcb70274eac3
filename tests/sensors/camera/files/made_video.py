"""Videos of known values, by PyAV's encoder without loss."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

TICK = Fraction(1, 600)


def make_video(
    path: Path,
    frames: Sequence[np.ndarray],
    stamps: Sequence[int] | None = None,
    *,
    turned: int = 0,
    shape: Fraction | None = None,
    options: dict[str, str] | None = None,
    kind: str = "yuv444p",
    **tags: int,
) -> Path:
    """Write planes of Y, Cb and Cr, (3, height, width), at ticks of 1/600 s.

    Args:
        path: The file; its suffix says which container.
        frames: Of one size.
        stamps: Ticks; by default 30 frames a second.
        turned: How many degrees counterclockwise it is to be shown turned.
        shape: Of a pixel, width over height.
        options: Of x264.
        kind: How pixels are stored; with chroma of fewer, or more bits, by FFV1.
        tags: Numbers of H.273: `colorspace`, `color_trc`, ...
    """
    stamps = [20 * k for k in range(len(frames))] if stamps is None else stamps
    with av.open(str(path), "w") as container:
        coder = "libx264" if kind == "yuv444p" else "ffv1"
        stream = container.add_stream(coder, rate=30)
        stream.height, stream.width = frames[0].shape[1:]
        stream.pix_fmt = kind
        stream.options = {"qp": "0", **(options or {})} if coder == "libx264" else {}
        if shape is not None:
            stream.codec_context.sample_aspect_ratio = shape
        if turned:
            stream.set_display_rotation(turned)
        for name, value in tags.items():
            setattr(stream.codec_context, name, value)
        stream.codec_context.time_base = TICK
        for planes, stamp in zip(frames, stamps, strict=True):
            frame = av.VideoFrame.from_ndarray(planes, format="yuv444p")
            frame = frame if kind == "yuv444p" else frame.reformat(format=kind)
            frame.pts, frame.time_base = stamp, TICK
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def grey(luma: np.ndarray) -> np.ndarray:
    """Return planes of a grey frame."""
    neutral = np.full_like(luma, 128)
    return np.stack([luma, neutral, neutral]).astype(np.uint8)


def flat(*values: int, height: int = 16, width: int = 32) -> list[np.ndarray]:
    """Return frames of one luma each."""
    return [grey(np.full((height, width), value)) for value in values]
