"""Many blasts on one clock: when and where they go off, who perceives what and when."""

from jblast.world.arrivals import (
    Arrivals as Arrivals,
    arrivals_in as arrivals_in,
    arrivals_of as arrivals_of,
)
from jblast.world.drawn import DrawnWorld as DrawnWorld, draw_world as draw_world
from jblast.world.imus import (
    ImuRecord as ImuRecord,
    imu_records as imu_records,
)
from jblast.world.jolts import picked_jolts as picked_jolts
from jblast.world.nevers import with_nevers as with_nevers
from jblast.world.one_blast import (
    scene_of_one_blast as scene_of_one_blast,
    scene_to_fit as scene_to_fit,
)
from jblast.world.perceived import Perceived as Perceived, perceived as perceived
from jblast.world.presets.preset import Preset as Preset, with_preset as with_preset
from jblast.world.presets.read import (
    preset_named as preset_named,
    read_world_by as read_world_by,
)
from jblast.world.presets.thesis import PRESETS as PRESETS
from jblast.world.readings import readings_of as readings_of
from jblast.world.riding import tracks_of as tracks_of
from jblast.world.schedule import (
    Blasts as Blasts,
    blast_sequence as blast_sequence,
    draw_blasts as draw_blasts,
    world_key as world_key,
)
