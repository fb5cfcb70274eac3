"""The messages of `blasts.proto`, made from its description as it was compiled.

`blasts.binpb` is how protoc describes `blasts.proto` to programs (`python -m
tests.tools.describe_messages` writes it anew, a test compares): data of protobuf's own
stable format. Python code that protoc generates is tied to the release
of protobuf that generated it, this is not, and grpcio-tools is not needed to run.
"""

import functools
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from jblast.errors import needed

PROTOCOL = 1
"""Goes up by one where an old client would misunderstand."""
PROTO = Path(__file__).with_name("blasts.proto")
DESCRIPTION = PROTO.with_suffix(".binpb")
SERVICE = "jblast.v1.Blasts"
METHODS = {
    "Describe": ("DescribeRequest", "World"),
    "Register": ("Registration", "Registered"),
    "Stream": ("Ask", "Packet"),
    "Announce": ("NewBlast", "Announced"),
    "Leave": ("LeaveRequest", "Left"),
}
"""Names of a method's messages; `Stream` streams both ways, the others neither."""


def grpc() -> Any:
    """Import gRPC.

    Raises:
        InputError: It is not installed.
    """
    needed("google.protobuf", "serve", "jblast serve", "worlds are served")
    needed("grpc.aio", "serve", "jblast serve", "worlds are served")
    import grpc

    return grpc


@functools.cache
def messages() -> Any:
    """Return the classes of messages, by name.

    Raises:
        InputError: protobuf is not installed.
    """
    needed("google.protobuf", "serve", "jblast serve", "worlds are served")
    with warnings.catch_warnings():  # of its own age
        warnings.simplefilter("ignore", DeprecationWarning)
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    pool = descriptor_pool.DescriptorPool()
    described = descriptor_pb2.FileDescriptorSet.FromString(DESCRIPTION.read_bytes())
    (file,) = described.file
    pool.Add(file)
    return SimpleNamespace(
        **{
            message.name: message_factory.GetMessageClass(
                pool.FindMessageTypeByName(f"{file.package}.{message.name}")
            )
            for message in file.message_type
        }
    )
