"""Arrays of microphones: when a front passed each, and from where it came."""

from jblast.detect.array.direction import Direction as Direction, direction as direction
from jblast.detect.array.pair_delay import (
    PairDelay as PairDelay,
    Weighting as Weighting,
    pair_delay as pair_delay,
)
from jblast.detect.array.relative_times import (
    RelativeTimes as RelativeTimes,
    relative_times as relative_times,
)
