"""The checksum of MAVLink's frames: CRC-16/MCRF4XX, the ITU's X.25 not inverted.

Python has the same polynomial from the highest bit down (`binascii.crc_hqx`); here the
lowest comes first, so bits are turned around before and after.
"""

import binascii

_TURNED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def checksum(data: bytes) -> int:
    """Return the checksum of bytes."""
    crc = binascii.crc_hqx(data.translate(_TURNED), 0xFFFF)
    return _TURNED[crc >> 8] | _TURNED[crc & 0xFF] << 8
