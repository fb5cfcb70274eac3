"""A world for several clients: entities, and the packets for each of them.

Nothing here depends on a network; `world.remote` adds the network.
"""

from jblast.world.server.playback import (
    AirPulse as AirPulse,
    Announcement as Announcement,
    BlastArrivals as BlastArrivals,
    ForceProfile as ForceProfile,
    Packet as Packet,
    Playback as Playback,
    Record as Record,
    Slice as Slice,
    Stager as Stager,
    announced_load as announced_load,
    packets_of as packets_of,
    played_force as played_force,
)
from jblast.world.server.registry import (
    BlastSchedule as BlastSchedule,
    BufferFull as BufferFull,
    Entity as Entity,
    Lockstep as Lockstep,
    Motion as Motion,
    PacketBuffer as PacketBuffer,
    PacketTimes as PacketTimes,
    Registry as Registry,
    ScaledRealTime as ScaledRealTime,
    checked_entity as checked_entity,
    checked_motion as checked_motion,
    packet_times as packet_times,
)
