"""A world that others take part in: who they are, what comes to them, packet by packet.

Nothing here knows of a network: `world.remote` carries it over one.
"""

from jblast.world.server.announced_load import announced_load as announced_load
from jblast.world.server.blast_schedule import BlastSchedule as BlastSchedule
from jblast.world.server.clock import (
    Lockstep as Lockstep,
    PacketTimes as PacketTimes,
    ScaledRealTime as ScaledRealTime,
    packet_times as packet_times,
)
from jblast.world.server.entity import (
    Entity as Entity,
    Motion as Motion,
    checked_entity as checked_entity,
    checked_motion as checked_motion,
)
from jblast.world.server.packet_buffer import (
    BufferFull as BufferFull,
    PacketBuffer as PacketBuffer,
)
from jblast.world.server.payload import (
    AirPulse as AirPulse,
    Announcement as Announcement,
    BlastArrivals as BlastArrivals,
    ForceProfile as ForceProfile,
    Packet as Packet,
    Record as Record,
    Slice as Slice,
)
from jblast.world.server.playback import Playback as Playback, packets_of as packets_of
from jblast.world.server.played_force import played_force as played_force
from jblast.world.server.registry import Registry as Registry
from jblast.world.server.staging import Stager as Stager
