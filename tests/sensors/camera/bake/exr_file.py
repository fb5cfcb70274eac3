"""OpenEXR files as Blender writes them, for tests; needs the standard library alone."""

import struct


def exr_bytes(channels: dict[str, list[list[float]]], compression: int = 0) -> bytes:
    """Return a file of single precision; channels are rows of pixels, from the top."""
    names = sorted(channels)
    height, width = len(channels[names[0]]), len(channels[names[0]][0])
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    listed = b"".join(
        name.encode() + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for name in names
    )
    header = b"\x76\x2f\x31\x01" + struct.pack("<i", 2)
    for name, kind, value in (
        ("channels", "chlist", listed + b"\0"),
        ("compression", "compression", bytes([compression])),
        ("dataWindow", "box2i", box),
        ("displayWindow", "box2i", box),
        ("lineOrder", "lineOrder", b"\0"),
    ):
        header += f"{name}\0{kind}\0".encode() + struct.pack("<i", len(value)) + value
    header += b"\0"
    size = 4 * width * len(names)
    start = len(header) + 8 * height
    offsets = [start + y * (size + 8) for y in range(height)]
    lines = b""
    for y in range(height):
        lines += struct.pack("<ii", y, size)
        for name in names:
            lines += struct.pack(f"<{width}f", *channels[name][y])
    return header + struct.pack(f"<{height}Q", *offsets) + lines
