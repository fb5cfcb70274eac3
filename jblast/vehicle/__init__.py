"""What a blast does to a vehicle: quadrotors in a wind, alone or a batch at once."""

from jblast.vehicle.control.allocation import (
    allocation as allocation,
    rotor_speeds as rotor_speeds,
)
from jblast.vehicle.control.cascade import Cascade as Cascade
from jblast.vehicle.control.gains import (
    Gains as Gains,
    gains_from_parameters as gains_from_parameters,
    named_gains as named_gains,
)
from jblast.vehicle.control.observed_hold import ObservedHold as ObservedHold
from jblast.vehicle.control.position_hold import (
    Controller as Controller,
    PositionHold as PositionHold,
)
from jblast.vehicle.control.step_limit import step_limit as step_limit
from jblast.vehicle.dynamics.state import State as State, Trajectory as Trajectory
from jblast.vehicle.from_scene import (
    CONTROLLERS as CONTROLLERS,
    controller_of as controller_of,
    hold_of as hold_of,
    start_of as start_of,
    vehicle_of as vehicle_of,
)
from jblast.vehicle.loads.blast.from_scene import blast_load as blast_load
from jblast.vehicle.loads.blast.load import BlastLoad as BlastLoad
from jblast.vehicle.loads.gusts import (
    FriedlanderGust as FriedlanderGust,
    NWaveGust as NWaveGust,
    StepGust as StepGust,
)
from jblast.vehicle.loads.impulse_table.file import (
    read_custom_profile as read_custom_profile,
)
from jblast.vehicle.loads.impulse_table.table import CustomProfile as CustomProfile
from jblast.vehicle.loads.load import Load as Load, Pulse as Pulse
from jblast.vehicle.loads.thesis.coded import (
    CodedLoad as CodedLoad,
    coded_load as coded_load,
)
from jblast.vehicle.loads.thesis.printed import (
    PrintedLoad as PrintedLoad,
    printed_load as printed_load,
)
from jblast.vehicle.metrics import (
    FlightMetrics as FlightMetrics,
    flight_metrics as flight_metrics,
    path_error as path_error,
)
from jblast.vehicle.quadrotor.body import Body as Body
from jblast.vehicle.quadrotor.models import named as named
from jblast.vehicle.quadrotor.parameters import (
    Vehicle as Vehicle,
    from_parameters as from_parameters,
)
from jblast.vehicle.rollout.batching import Each as Each
from jblast.vehicle.simulate import STEP_S as STEP_S, simulate as simulate
