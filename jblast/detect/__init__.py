"""Was there a blast: matched filters, thresholds, arrivals to a part of a sample.

Sound comes in as NumPy arrays and is filtered by NumPy's transforms in float64, not by
JAX's: no gradient is asked for here, a transform of a block takes three quarters of the
time, and no command waits for compilation (`calibration/detector_limits.py`).
"""

from jblast.detect.kernel import (
    MatchedKernel as MatchedKernel,
    matched_kernel as matched_kernel,
)
from jblast.detect.matched_filter import (
    Filtered as Filtered,
    filtered_by as filtered_by,
    matched_filter as matched_filter,
)
from jblast.detect.overlap_save import OverlapSave as OverlapSave
from jblast.detect.peaks import (
    Detection as Detection,
    PeakPicker as PeakPicker,
    detections as detections,
)
from jblast.detect.stream import Stream as Stream, stream as stream
from jblast.detect.threshold import (
    false_alarms_at as false_alarms_at,
    threshold_for as threshold_for,
)
from jblast.detect.whitening import (
    NoiseSpectrum as NoiseSpectrum,
    noise_spectrum as noise_spectrum,
    white_noise as white_noise,
)
