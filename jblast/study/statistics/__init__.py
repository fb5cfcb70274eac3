"""Statistics of a stream: added to in blocks, merged in the order of the samples."""

from jblast.study.statistics.kinds import (
    ACCUMULATORS as ACCUMULATORS,
    NUMBER as NUMBER,
    YES_NO as YES_NO,
    Accumulator as Accumulator,
)
from jblast.study.statistics.moments import Moments as Moments
from jblast.study.statistics.number import NumberState as NumberState
from jblast.study.statistics.quantile_sketch import (
    QuantileSketch as QuantileSketch,
    origin_of as origin_of,
)
from jblast.study.statistics.share import (
    LEVEL as LEVEL,
    ShareState as ShareState,
    wilson_interval as wilson_interval,
)
from jblast.study.statistics.stream import BLOCK as BLOCK, fold as fold
