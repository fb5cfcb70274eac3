"""Fly a scene's vehicle through its blasts, hovering or on a mission.

The flight begins at time 0 of the scene, over level ground at height 0, in the scene's
wind. A blast arrives at its charge's time_s plus the travel time to the vehicle. By
default two position controllers fly side by side, with and without integral action;
--controllers selects others. A crash is a result: the exit code is 0.

If the scene's [vehicle] has a mission, a plan of QGroundControl, the vehicle flies it
from the ground until it has landed and is disarmed.

example:
  jblast fly flight.toml --vehicles 500 --out flights

input:
  SCENE.toml            path; scene file with a [vehicle]: model, position_m, and
      optionally velocity_m_s, control or mission; parameters with a prior are sampled
  --profile FILE.csv    path; impulses of blasts from another program, in place of the
      laws; the charge gives their position and time
model:
  --vehicles N          integer = 1; number of scenes sampled from the priors
  --seconds S           positive; duration of the flight [s] (default: until 5 s after
      the last blast's arrival; of a mission until it is disarmed); required without a
      blast and mission
  --controllers NAME,...  names; controllers that fly through the same blasts: hold
      (SE(3), as in the scene), with_integral, without_integral, cascade (as in PX4)
      (default: with_integral,without_integral)
  --estimator ekf       choice; state estimator, fed by simulated instruments, with the
      effect of each blast on the estimate; steps of 0.004 s (default: true state)
output:
  --out DIR             path; folder for fly.json, report.html and flight.csv with
      flight.png; for several vehicles flights.csv and distribution.png; for a mission
      also map.png
  --plan-out FILE       path; copy of the mission's plan, in QGroundControl's format
  ...out
advanced:
  --step S              positive; time step of the integrator [s] (default: 0.0005; of a
      mission 0.004)
  --backend auto|jax|warp  text = auto; backend; warp:cpu and warp:cuda:0 name a device
  --tolerance M         positive; path error at which the vehicle counts as recovered
      [m] (default: 0.05; of a mission 0.2)
  --profile-moments-about X,Y,Z  numbers; vector from the reference point of the
      profile's moments to the vehicle's centre of mass, body axes [m] (default: 0,0,0;
      moments whose lever arm is longer than 3 times that of the farthest rotor are then
      rejected)
  --seed N              seed = 0; seed of the priors
"""

import argparse
from dataclasses import replace

from jblast.errors import InputError
from jblast.files import check_out, refuse_existing


def run(options: argparse.Namespace) -> int:
    """Fly, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.missions.plan import check_form, check_mission, plan_text
    from jblast.progress import stages

    begin = stages({"starting": 1.0, "flying": 8.0, "writing": 1.0})
    begin("starting")
    check_mission(options.scene)  # fails here, before JAX starts
    # a single flight is serial: more devices would only cost start time
    start_jax(all_cores=options.vehicles > 1)
    from jblast.report.flights import FILES, fly_answer
    from jblast.report.output import deliver
    from jblast.study.flights import fly, has_mission, scene_to_run

    if options.out:
        check_out(options.out, ("fly.json", *FILES), force=options.force)
    uncertain = scene_to_run(options.scene, seconds=options.seconds, seed=options.seed)
    # before the flight, which may take minutes with many vehicles
    if options.plan_out and not has_mission(uncertain):
        # there is no plan to copy, and the file would be missing silently
        raise InputError(
            "--plan-out: expected a scene whose [vehicle] has a mission, got one "
            "without a mission"
        )
    if options.plan_out:
        refuse_existing(options.plan_out, force=options.force)
        check_form(options.plan_out)
    begin("flying")
    flown = fly(
        uncertain,
        vehicles=options.vehicles,
        controllers=tuple(options.controllers) or None,
        seconds=options.seconds,
        step_s=options.step,
        tolerance_m=options.tolerance,
        profile=options.profile,
        profile_moments_about=options.profile_moments_about,
        seed=options.seed,
        backend=options.backend,
        estimator=options.estimator or "",
    )
    begin("writing")
    answer = fly_answer(flown, scene=options.scene, seed=options.seed)
    if flown.mission is not None and options.plan_out:
        text = plan_text(flown.mission.plan, options.plan_out)
        answer = replace(answer, saved={options.plan_out: text})
    return deliver(answer, options, folder=options.out, names=FILES)
