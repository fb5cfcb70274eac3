"""What a camera records: frames, and events."""

from jblast.sensors.camera.events.exact.crossing_times import (
    frameless_events as frameless_events,
)
from jblast.sensors.camera.events.exact.fireball import (
    pixel_light as pixel_light,
    render_events as render_events,
)
from jblast.sensors.camera.events.exact.implicit_gradient import (
    implicit_times as implicit_times,
)
from jblast.sensors.camera.events.ideal import (
    Events as Events,
    continued_events as continued_events,
    ideal_events as ideal_events,
    reset_events as reset_events,
)
from jblast.sensors.camera.events.log_intensity import log_intensity as log_intensity
from jblast.sensors.camera.events.noise import (
    IDEAL as IDEAL,
    NoiseModel as NoiseModel,
)
from jblast.sensors.camera.events.noisy import (
    noisy_events as noisy_events,
    noisy_stream as noisy_stream,
)
from jblast.sensors.camera.events.scene import events as events
from jblast.sensors.camera.events.soft_counts import smooth_counts as smooth_counts
from jblast.sensors.camera.events.stream import stream_events as stream_events
from jblast.sensors.camera.files.events.read import read_events as read_events
from jblast.sensors.camera.files.events.recorded import (
    RecordedEvents as RecordedEvents,
)
from jblast.sensors.camera.files.events.write import write_events as write_events
from jblast.sensors.camera.files.explosion_set import (
    explosion_views as explosion_views,
)
from jblast.sensors.camera.files.recordings import (
    ImageSequence as ImageSequence,
    open_recording as open_recording,
)
from jblast.sensors.camera.files.views import (
    read_views as read_views,
    single_view as single_view,
)
from jblast.sensors.camera.geometry.camera_path import CameraPath as CameraPath
from jblast.sensors.camera.geometry.pixel_rays import (
    Rays as Rays,
    pixel_rays as pixel_rays,
)
from jblast.sensors.camera.geometry.projection import (
    Projected as Projected,
    project as project,
)
from jblast.sensors.camera.geometry.unproject import (
    undistort as undistort,
    unproject as unproject,
)
from jblast.sensors.camera.image.blackbody import blackbody_light as blackbody_light
from jblast.sensors.camera.image.compositing import (
    linear_to_srgb as linear_to_srgb,
    over as over,
    srgb_to_linear as srgb_to_linear,
)
from jblast.sensors.camera.image.grey_composite import (
    LUMINANCE as LUMINANCE,
    luminance as luminance,
)
from jblast.sensors.camera.rendering.appearance import Appearance as Appearance
from jblast.sensors.camera.rendering.baked.explosion_views import (
    ExplosionViews as ExplosionViews,
)
from jblast.sensors.camera.rendering.billboards import Views as Views
from jblast.sensors.camera.rendering.carried import render_carried as render_carried
from jblast.sensors.camera.rendering.fireball_image import (
    fireball_layer as fireball_layer,
)
from jblast.sensors.camera.rendering.landscape import (
    Landscape as Landscape,
    landscape as landscape,
)
from jblast.sensors.camera.rendering.render import render as render
from jblast.sensors.camera.rendering.view_set import ViewSet as ViewSet
