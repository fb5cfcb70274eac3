"""The load of a blast wave: the pulse at the vehicle, its drag and its impulse."""
