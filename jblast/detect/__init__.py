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
    unsteadiness as unsteadiness,
)
from jblast.detect.overlap_save import OverlapSave as OverlapSave
from jblast.detect.peaks import (
    Detection as Detection,
    PeakPicker as PeakPicker,
    detections as detections,
)
from jblast.detect.sta_lta import (
    Trigger as Trigger,
    sta_lta as sta_lta,
    triggers as triggers,
)
from jblast.detect.stream import Stream as Stream, stream as stream
from jblast.detect.template_bank import (
    Match as Match,
    Member as Member,
    best_match as best_match,
    template_bank as template_bank,
)
from jblast.detect.templates import (
    blast_template as blast_template,
    recorded_template as recorded_template,
)
from jblast.detect.threshold import (
    false_alarms_at as false_alarms_at,
    threshold_for as threshold_for,
)
from jblast.detect.whitening import (
    NoiseSpectrum as NoiseSpectrum,
    noise_spectrum as noise_spectrum,
    white_noise as white_noise,
)
