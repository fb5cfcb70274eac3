"""What is there: charge, air, ground, sensors, camera, vehicle; what is not known."""

from jblast.parameter_table import PARAMETERS as PARAMETERS
from jblast.scene.air import Air as Air
from jblast.scene.ambient import Ambient as Ambient
from jblast.scene.camera import Camera as Camera
from jblast.scene.charge import Charge as Charge
from jblast.scene.explosives import EXPLOSIVES as EXPLOSIVES
from jblast.scene.ground import Ground as Ground
from jblast.scene.instrument import Imu as Imu, Instrument as Instrument
from jblast.scene.parameters import (
    parameter_named as parameter_named,
    place_of as place_of,
    value_of as value_of,
    with_values as with_values,
)
from jblast.scene.pose import (
    look_at as look_at,
    matrix_quaternion as matrix_quaternion,
    quaternion_matrix as quaternion_matrix,
)
from jblast.scene.priors import (
    Free as Free,
    LogNormal as LogNormal,
    LogUniform as LogUniform,
    Normal as Normal,
    Uniform as Uniform,
)
from jblast.scene.random.spec import (
    Box as Box,
    ByCount as ByCount,
    ByRate as ByRate,
    ByTick as ByTick,
    Ring as Ring,
    WorldSpec as WorldSpec,
)
from jblast.scene.reader.scene import (
    read_scene as read_scene,
    read_scene_or_world as read_scene_or_world,
    read_world as read_world,
)
from jblast.scene.scene import Scene as Scene
from jblast.scene.sensor import Clock as Clock, Sensor as Sensor
from jblast.scene.uncertain import (
    Place as Place,
    UncertainScene as UncertainScene,
    default_scene as default_scene,
    draw_scene as draw_scene,
    freed as freed,
    with_laws as with_laws,
)
from jblast.scene.vehicle import VehicleSpec as VehicleSpec
