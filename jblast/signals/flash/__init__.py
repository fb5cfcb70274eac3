"""Flashes of blasts in films and camera events: time, place and growth."""

from jblast.signals.flash.fireball import (
    Direction as Direction,
    Growth as Growth,
    Silhouette as Silhouette,
    direction_of as direction_of,
)
from jblast.signals.flash.search import (
    Candidate as Candidate,
    Flash as Flash,
    FlashDetections as FlashDetections,
    FlashWatch as FlashWatch,
    detect_flashes as detect_flashes,
    event_changes as event_changes,
    flash_threshold as flash_threshold,
    log_of as log_of,
)
