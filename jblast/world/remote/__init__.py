"""A world over the network, by gRPC: server and client, an optional extra.

gRPC is used because C++ plugins can generate their client from the `.proto` file. It
also validates messages, has bidirectional streams with flow control, and supports
tokens and TLS.
"""

from jblast.world.remote.client import Client as Client, connect as connect
from jblast.world.remote.serving import Options as Options, serving as serving
