"""Where MAVLink is spoken: tcp:HOST:PORT or udp:HOST:PORT, on this machine only."""

import ipaddress
from typing import NamedTuple

from jblast.errors import InputError, argument, shown


class Address(NamedTuple):
    """Where to.

    Attributes:
        kind: "tcp" or "udp".
        host: Of the loopback.
        port: 0: any free one.
    """

    kind: str
    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind}:{host}:{self.port}"


def read_address(text: str, name: str, port: int) -> Address:
    """Read an address; what is left out is this machine, and the usual port.

    Args:
        text: As it was given: "tcp", "tcp:HOST" or "tcp:HOST:PORT", and "udp" likewise.
        name: Of the argument.
        port: The usual one.

    Raises:
        InputError: It is none, or others than this machine could be reached by it:
            MAVLink asks nobody who he is.
    """
    where = argument(name)
    kind, _, rest = text.partition(":")
    host, colon, said = rest.rpartition(":")
    if not colon:
        host, said = rest, str(port)
    bare = host.removeprefix("[").removesuffix("]") or "127.0.0.1"
    if kind not in ("tcp", "udp") or not (said.isascii() and said.isdigit()):
        raise InputError(
            f"{where}: expected tcp:HOST:PORT or udp:HOST:PORT, got {shown(text)}"
        )
    if int(said) > 65535:
        raise InputError(f"{where}: expected a port of 0 to 65535, got {said}")
    if not _is_loopback(bare):
        raise InputError(
            f"{where}: expected a loopback address, as {kind}:127.0.0.1:{port}: others "
            f"could reach {shown(bare)}, and MAVLink has no token to show; a tunnel by "
            "ssh takes it to another machine"
        )
    return Address(kind, "127.0.0.1" if bare == "localhost" else bare, int(said))


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
