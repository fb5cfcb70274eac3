"""A world for several clients: entities, the packets for each of them, and a server.

`Playback` and `packets_of` give the packets in one process. `serving` and `connect` are
the server and the client over gRPC, an optional extra.
"""

from jblast.world.serve.client import Client as Client, connect as connect
from jblast.world.serve.entities import (
    Entity as Entity,
    Knot as Knot,
    Motion as Motion,
    NewBlast as NewBlast,
    Options as Options,
    PacketTimes as PacketTimes,
    ServedWorld as ServedWorld,
    packet_times as packet_times,
)
from jblast.world.serve.service import serving as serving
from jblast.world.serve.staging import (
    Announcement as Announcement,
    Packet as Packet,
    Playback as Playback,
    Rows as Rows,
    announced_load as announced_load,
    packets_of as packets_of,
    stage as stage,
)
