"""AEDAT4, the event files of iniVation's cameras.

A line that names the format; a header (a FlatBuffer) whose text in XML tells the
streams; then packets: stream, length, and a FlatBuffer of events, 16 bytes each.

They are read by dv-processing, which knows how packets are compressed. They are written
here, uncompressed: dv-processing takes events from Python one at a time.

References:
    iniVation, AEDAT 4.0 file format; dv-processing, its FlatBuffers schemas.
"""
