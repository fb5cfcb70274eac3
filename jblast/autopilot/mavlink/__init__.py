"""MAVLink 2 on the wire: frames, by pymavlink, and the links that they go over."""
