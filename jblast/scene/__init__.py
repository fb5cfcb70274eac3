"""What is there: charge, air, ground, sensors, and what is not known of them."""

from jblast.scene.air import Air as Air
from jblast.scene.charge import Charge as Charge
from jblast.scene.clock import Clock as Clock
from jblast.scene.explosives import EXPLOSIVES as EXPLOSIVES
from jblast.scene.ground import Ground as Ground
from jblast.scene.parameters import PARAMETERS as PARAMETERS
from jblast.scene.parameters import place_of as place_of
from jblast.scene.parameters import value_of as value_of
from jblast.scene.parameters import with_values as with_values
from jblast.scene.priors import Free as Free
from jblast.scene.priors import LogNormal as LogNormal
from jblast.scene.priors import LogUniform as LogUniform
from jblast.scene.priors import Normal as Normal
from jblast.scene.priors import Uniform as Uniform
from jblast.scene.read import read_scene as read_scene
from jblast.scene.scene import Scene as Scene
from jblast.scene.sensor import Sensor as Sensor
from jblast.scene.uncertain import UncertainScene as UncertainScene
from jblast.scene.uncertain import default_scene as default_scene
from jblast.scene.uncertain import draw_scene as draw_scene
from jblast.scene.uncertain import freed as freed
from jblast.scene.uncertain import with_laws as with_laws
