"""placeholder until merge."""


class RunDetectors:
    def __init__(self, scene, arrivals): ...
    def take(self, packet):
        return ()
