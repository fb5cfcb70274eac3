"""What a microphone hears: blasts, ambient sound, wind and its own rotors."""

from jblast.sensors.microphone.blast import WavePaths as WavePaths
from jblast.sensors.microphone.packets import LoopPackets as LoopPackets
from jblast.sensors.microphone.record import record as record, stream as stream
from jblast.sensors.microphone.rotor import Rotors as Rotors
from jblast.sensors.signal.blocks import Packet as Packet
from jblast.sensors.signal.quantise import Clipping as Clipping, clipping as clipping
