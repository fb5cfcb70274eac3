"""Stands for Blender: reads the same settings, writes balls as OpenEXR pictures.

The variable FAKE_BLENDER is the number of pictures after which it fails.
"""

import json
import os
import struct
import sys
from pathlib import Path

import numpy as np


def exr_bytes(picture: np.ndarray) -> bytes:
    """Return an uncompressed picture of single precision; height, width, RGBA."""
    height, width, _ = picture.shape
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    listed = b"".join(
        c + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for c in b"A B G R".split()
    )
    header = b"\x76\x2f\x31\x01" + struct.pack("<i", 2)
    for name, kind, value in (
        ("channels", "chlist", listed + b"\0"),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", box),
        ("displayWindow", "box2i", box),
        ("lineOrder", "lineOrder", b"\0"),
    ):
        header += f"{name}\0{kind}\0".encode() + struct.pack("<i", len(value)) + value
    header += b"\0"
    size = 16 * width
    places = np.arange(height) * (size + 8) + len(header) + 8 * height
    lines = (
        struct.pack("<ii", y, size) + row.T[::-1].astype("<f4").tobytes()
        for y, row in enumerate(picture)
    )
    return header + places.astype("<u8").tobytes() + b"".join(lines)


def ball(size: int, number: int, layer: str) -> np.ndarray:
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    inside = (np.hypot(x, y) < size * (0.15 + 0.02 * number)).astype(float)
    light = 1.0 if layer == "glow" else 0.25
    return np.stack([light * inside] * 3 + [inside], axis=-1)


def main() -> None:
    if sys.argv[1:] == ["--version"]:
        print("Blender 3.4.1")  # noqa: T201
        return
    config = json.loads(Path(sys.argv[-1]).read_text())
    if "baked" in config:
        seen = [{"hot": 1.0, "reach": 0.5, "top": 0.02 * n} for n in config["frames"]]
        Path(config["baked"]).write_text(json.dumps(seen))
        return
    drawn = 0
    for view in config["views"]:
        folder = Path(view["folder"])
        folder.mkdir(parents=True, exist_ok=True)
        for number in range(len(config["frames"])):
            for layer in ("glow", "shade"):
                path = folder / f"{number:04d}.{layer}.exr"
                if drawn == int(os.environ.get("FAKE_BLENDER", "-1")):
                    sys.exit("Error: out of memory")
                if not path.exists():
                    drawn += 1
                    part = path.with_name("part")
                    part.write_bytes(exr_bytes(ball(config["size"], number, layer)))
                    part.rename(path)


if __name__ == "__main__":
    main()
