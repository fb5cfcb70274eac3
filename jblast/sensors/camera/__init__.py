"""What a camera records: frames, and events."""

from jblast.sensors.camera.event_files import write_events as write_events
from jblast.sensors.camera.event_stream import stream_events as stream_events
from jblast.sensors.camera.events import (
    Events as Events,
    continued_events as continued_events,
    ideal_events as ideal_events,
)
from jblast.sensors.camera.imperfections import (
    IDEAL as IDEAL,
    Imperfections as Imperfections,
)
from jblast.sensors.camera.projection import (
    Projected as Projected,
    project as project,
)
from jblast.sensors.camera.real_events import (
    real_events as real_events,
    real_stream as real_stream,
)
from jblast.sensors.camera.smooth_counts import smooth_counts as smooth_counts
from jblast.sensors.camera.unproject import (
    undistort as undistort,
    unproject as unproject,
)
