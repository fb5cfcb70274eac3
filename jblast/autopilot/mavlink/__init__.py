"""MAVLink 2 on the wire: the messages that are spoken here, and their frames."""
