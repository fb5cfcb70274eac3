"""A world over the network, by gRPC: server and client, an optional extra.

gRPC is used because a `.proto` file gives a plugin in C++ its client. It also checks
the form of messages, streams in both directions with flow control, and supports tokens
and TLS.
"""

from jblast.world.remote.client import Client as Client, connect as connect
from jblast.world.remote.serving import Options as Options, serving as serving
