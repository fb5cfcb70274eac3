"""Flights of quadrotors through winds and blasts, one vehicle or a batch."""

from jblast.vehicle.control.allocation import (
    allocation as allocation,
    rotor_speeds as rotor_speeds,
)
from jblast.vehicle.control.cascade import Cascade as Cascade
from jblast.vehicle.control.position_hold import (
    Commands as Commands,
    Controller as Controller,
    Gains as Gains,
    PositionHold as PositionHold,
    gains_from_parameters as gains_from_parameters,
    named_gains as named_gains,
)
from jblast.vehicle.control.stability import step_limit as step_limit
from jblast.vehicle.controllers import (
    CONTROLLERS as CONTROLLERS,
    ControllerKind as ControllerKind,
    controller_of as controller_of,
    hold_of as hold_of,
)
from jblast.vehicle.from_scene import (
    blast_load as blast_load,
    start_of as start_of,
    vehicle_of as vehicle_of,
)
from jblast.vehicle.loads.blast import BlastLoad as BlastLoad
from jblast.vehicle.loads.impulse_table import (
    CustomProfile as CustomProfile,
    read_custom_profile as read_custom_profile,
)
from jblast.vehicle.loads.load import (
    Gust as Gust,
    Load as Load,
    Pulse as Pulse,
    friedlander as friedlander,
    n_wave as n_wave,
    steady as steady,
)
from jblast.vehicle.metrics import (
    FlightMetrics as FlightMetrics,
    flight_metrics as flight_metrics,
    path_error as path_error,
)
from jblast.vehicle.quadrotor import (
    Body as Body,
    Vehicle as Vehicle,
    from_parameters as from_parameters,
    named as named,
)
from jblast.vehicle.simulate import STEP_S as STEP_S, simulate as simulate
from jblast.vehicle.state import State as State, Trajectory as Trajectory
