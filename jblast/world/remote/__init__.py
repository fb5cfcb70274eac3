"""A world over the network, by gRPC: server and client, an optional extra.

gRPC is used because C++ plugins can generate their client from the `.proto` file. It
also validates messages and has bidirectional streams with flow control.
"""

from jblast.world.remote.client import Client as Client, connect as connect
from jblast.world.remote.serving import Options as Options, serving as serving
