"""A world over the network, by gRPC: server and client, an extra of ours.

gRPC, since a `.proto` file gives a plugin in C++ its client, checks the form of what
comes, streams both ways with flow control, and knows tokens and TLS.
"""

from jblast.world.remote.client import Client as Client, connect as connect
from jblast.world.remote.serving import Options as Options, serving as serving
