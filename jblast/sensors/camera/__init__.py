"""Cameras: frames of a scene, and the events of an event camera."""

from jblast.sensors.camera.explosion import ExplosionViews as ExplosionViews
from jblast.sensors.camera.files.event_files import (
    read_events as read_events,
    write_events as write_events,
)
from jblast.sensors.camera.files.recorded_events import (
    RecordedEvents as RecordedEvents,
)
from jblast.sensors.camera.files.recordings import (
    ImageSequence as ImageSequence,
    open_recording as open_recording,
)
from jblast.sensors.camera.files.views import explosion_views as explosion_views
from jblast.sensors.camera.film import Film as Film, film_to_events as film_to_events
from jblast.sensors.camera.film_writer import write_film as write_film
from jblast.sensors.camera.fireball import Appearance as Appearance
from jblast.sensors.camera.geometry import (
    CameraPath as CameraPath,
    Projected as Projected,
    Rays as Rays,
    pixel_rays as pixel_rays,
    project as project,
    undistort as undistort,
    unproject as unproject,
)
from jblast.sensors.camera.image import (
    LUMINANCE as LUMINANCE,
    blackbody_light as blackbody_light,
    linear_to_srgb as linear_to_srgb,
    luminance as luminance,
    srgb_to_linear as srgb_to_linear,
)
from jblast.sensors.camera.pixel import (
    Events as Events,
    Held as Held,
    NoiseModel as NoiseModel,
    Pixel as Pixel,
    log_intensity as log_intensity,
    noisy_pixel as noisy_pixel,
    pixel_events as pixel_events,
    smooth_counts as smooth_counts,
)
from jblast.sensors.camera.rendering import View as View, render as render
from jblast.sensors.camera.scene_events import (
    events as events,
    film_events as film_events,
)
from jblast.sensors.camera.stream import (
    event_stream as event_stream,
    joined as joined,
)
from jblast.sensors.camera.surroundings import (
    Landscape as Landscape,
    landscape as landscape,
)
