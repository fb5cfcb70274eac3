"""Many blasts on one clock: their times and places, and who perceives them."""

from jblast.world.drawn import (
    Blasts as Blasts,
    DrawnWorld as DrawnWorld,
    blast_sequence as blast_sequence,
    draw_blasts as draw_blasts,
    draw_world as draw_world,
    read_run_scene as read_run_scene,
    scene_of_one_blast as scene_of_one_blast,
    scene_to_fit as scene_to_fit,
    tracks_of as tracks_of,
    with_nevers as with_nevers,
    world_key as world_key,
)
from jblast.world.perceived import (
    Arrivals as Arrivals,
    Perceived as Perceived,
    arrivals_of as arrivals_of,
    perceived as perceived,
    readings_of as readings_of,
)
from jblast.world.picked import (
    ImuRecord as ImuRecord,
    imu_records as imu_records,
    picked_jolts as picked_jolts,
)
