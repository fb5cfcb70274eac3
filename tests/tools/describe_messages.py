"""How protoc describes `blasts.proto` to programs, by grpcio-tools.

`python -m tests.tools.describe_messages` writes it beside the `.proto`.
"""

import tempfile
from pathlib import Path

from grpc_tools import protoc

from jblast.files import write_bytes
from jblast.world.serve.messages import DESCRIPTION, PROTO


def described() -> bytes:
    """Return what protoc makes of the `.proto`."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        assert protoc.main(["", f"-I{PROTO.parent}", f"-o{out}", PROTO.name]) == 0
        return out.read_bytes()


if __name__ == "__main__":
    write_bytes(DESCRIPTION, described())
