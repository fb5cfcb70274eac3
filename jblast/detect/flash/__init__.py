"""Was there a blast in what a camera saw: its flash, when, where, and how it grew."""

from jblast.detect.flash.directions import (
    Direction as Direction,
    direction_of as direction_of,
)
from jblast.detect.flash.event_changes import event_changes as event_changes
from jblast.detect.flash.growth import Growth as Growth
from jblast.detect.flash.log import log_of as log_of
from jblast.detect.flash.search import (
    Flash as Flash,
    FlashDetections as FlashDetections,
    Rejected as Rejected,
    detect_flashes as detect_flashes,
)
from jblast.detect.flash.silhouette import Silhouette as Silhouette
from jblast.detect.flash.tail import flash_threshold as flash_threshold
from jblast.detect.flash.vertical_events import VerticalEvents as VerticalEvents
