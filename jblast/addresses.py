"""Network addresses: host and port, and loopback hosts."""

import ipaddress

from jblast.errors import InputError, shown, whole_number

MOST_PORT = 65535
"""Largest port of TCP and UDP: 16 bits (RFC 9293, RFC 768)."""


def host_and_port(
    text: str, where: str, expected: str, *, got: str = ""
) -> tuple[str, int]:
    """Return host, without the brackets of IPv6, and port of a loopback HOST:PORT.

    Servers have no authentication: any host that reaches the port controls them.

    Args:
        text: HOST:PORT or [HOST]:PORT.
        where: Beginning of messages.
        expected: Expected form, for messages.
        got: Text quoted in messages, if `text` is a part of it.

    Raises:
        InputError: The text has another form, its port is larger than `MOST_PORT`, or
            its host is not `localhost` or a loopback address.
    """
    # From the right, as IPv6 addresses have colons themselves.
    host, _, digits = text.rpartition(":")
    port = whole_number(digits)
    bare = host.removeprefix("[").removesuffix("]")
    if not bare or port is None:
        raise InputError(f"{where}: expected {expected}, got {shown(got or text)}")
    if port > MOST_PORT:
        raise InputError(f"{where}: expected a port of 0 to {MOST_PORT}, got {port}")
    try:
        # Names are not resolved, because a resolver may be slow or answer otherwise
        # later.
        loopback = bare == "localhost" or ipaddress.ip_address(bare).is_loopback
    except ValueError:
        loopback = False
    if not loopback:
        raise InputError(
            f"{where}: expected a loopback address, as 127.0.0.1, got {shown(bare)}; "
            "servers have no authentication, so use ssh -L to another machine"
        )
    return bare, port
