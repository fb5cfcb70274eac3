"""What a camera records: frames, and events."""

from jblast.sensors.camera.blackbody import blackbody_light as blackbody_light
from jblast.sensors.camera.compositing import (
    linear_to_srgb as linear_to_srgb,
    over as over,
    srgb_to_linear as srgb_to_linear,
)
from jblast.sensors.camera.crossing_times import (
    frameless_events as frameless_events,
)
from jblast.sensors.camera.event_files import write_events as write_events
from jblast.sensors.camera.event_stream import stream_events as stream_events
from jblast.sensors.camera.events import (
    Events as Events,
    continued_events as continued_events,
    ideal_events as ideal_events,
    reset_events as reset_events,
)
from jblast.sensors.camera.fireball_image import fireball_layer as fireball_layer
from jblast.sensors.camera.grey_composite import (
    LUMINANCE as LUMINANCE,
    luminance as luminance,
)
from jblast.sensors.camera.imperfections import (
    IDEAL as IDEAL,
    Imperfections as Imperfections,
)
from jblast.sensors.camera.implicit_times import implicit_times as implicit_times
from jblast.sensors.camera.log_intensity import log_intensity as log_intensity
from jblast.sensors.camera.look import Look as Look
from jblast.sensors.camera.pixel_rays import Rays as Rays, pixel_rays as pixel_rays
from jblast.sensors.camera.projection import (
    Projected as Projected,
    project as project,
)
from jblast.sensors.camera.real_events import (
    real_events as real_events,
    real_stream as real_stream,
)
from jblast.sensors.camera.render import render as render
from jblast.sensors.camera.render_events import (
    pixel_light as pixel_light,
    render_events as render_events,
)
from jblast.sensors.camera.scene_events import events as events
from jblast.sensors.camera.smooth_counts import smooth_counts as smooth_counts
from jblast.sensors.camera.unproject import (
    undistort as undistort,
    unproject as unproject,
)
from jblast.sensors.camera.view_files import (
    read_views as read_views,
    single_view as single_view,
)
from jblast.sensors.camera.views import Views as Views, views_seen as views_seen
