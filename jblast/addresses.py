"""Network addresses: host and port, and loopback hosts."""

import ipaddress

from jblast.errors import InputError, shown, whole_number

MOST_PORT = 65535
"""Largest port of TCP and UDP: 16 bits (RFC 9293, RFC 768)."""


def host_and_port(
    text: str, where: str, expected: str, *, got: str = ""
) -> tuple[str, int]:
    """Return the host of HOST:PORT, without the brackets of IPv6, and its port.

    Args:
        text: HOST:PORT or [HOST]:PORT.
        where: Beginning of messages.
        expected: Expected form, for messages.
        got: Text quoted in messages, if `text` is a part of it.

    Raises:
        InputError: The text has another form, or its port is larger than `MOST_PORT`.
    """
    # From the right, as IPv6 addresses have colons themselves.
    host, _, digits = text.rpartition(":")
    port = whole_number(digits)
    bare = host.removeprefix("[").removesuffix("]")
    if not bare or port is None:
        raise InputError(f"{where}: expected {expected}, got {shown(got or text)}")
    if port > MOST_PORT:
        raise InputError(f"{where}: expected a port of 0 to {MOST_PORT}, got {port}")
    return bare, port


def is_loopback(host: str) -> bool:
    """Return whether a host is `localhost` or a loopback address.

    Other names are not resolved and give False.
    """
    if host == "localhost":
        return True
    try:
        # Names are not resolved, because a resolver may be slow or answer otherwise
        # later.
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
