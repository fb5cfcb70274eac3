"""Numbers of a scene that stand alone: not one to each charge or sensor."""

from jblast.scene import PARAMETERS

ALONE = [one for one in PARAMETERS.values() if one.key.index is None]
