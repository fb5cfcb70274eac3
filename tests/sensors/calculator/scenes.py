"""A scene to calculate in."""

from jblast.scene import Air, Charge, Ground, Scene


def scene_with(sound_speed=330.0, pressure=9e4, **charge):
    air = Air(pressure=pressure, sound_speed=sound_speed)
    return Scene(charge=Charge(**charge), air=air, ground=Ground(p_speed=6000.0))
