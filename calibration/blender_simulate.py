"""Simulation of an explosion on the ground by Mantaflow, run by Blender.

    blender -b --factory-startup --python SCRIPT -- CONFIG.json

Balls of burning fuel fly out from the ground and slow down, which makes the lobes of
the fireball. Hot gas rises, draws in air and rolls up. A ring of dust is swept outwards
below. CONFIG specifies the cache, the resolution of the grid, the seed and the frames
to be rendered. The heat and the extent of these frames are written to a file. Nothing
is imported from jblast, which Blender's Python does not have.
"""

import contextlib
import ctypes
import json
import math
import os
import random
import sys

# Directions turned by the golden angle never line up: the most even spread for any
# count (Vogel 1979, Math. Biosci. 44:179).
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
SOOT, DUST = (0.21, 0.185, 0.16), (0.6, 0.48, 0.35)
"""Colours of the products of fuel, and of the ground [-]. Chosen by eye."""
VISIBLE = 0.02
"""Density from which gas counts for the framing: less is hardly visible."""


def main() -> None:
    """Build the scene, simulate it, save it, and write the extents of its frames."""
    # PR_SET_PDEATHSIG: Blender ends with the process that started it (Linux only).
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(1, 9, 0, 0, 0)
    with open(sys.argv[sys.argv.index("--") + 1], encoding="utf-8") as file:
        config = json.load(file)
    import bpy  # type: ignore (Blender's own)

    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    physics = config["physics"]
    scene = bpy.context.scene
    scene.render.fps = 24
    scene.frame_start, scene.frame_end = 1, physics["last"]
    # one generator in a fixed order: a seed defines all lobes and puffs
    draw = random.Random(config["seed"])
    add_fire(bpy, physics, draw)
    add_dust(bpy, physics, draw)
    # added last: an evaluated domain without a cache makes every operator fail
    domain = add_domain(bpy, physics, config["cache"])
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = domain
    domain.select_set(True)
    if bpy.ops.fluid.bake_all() != {"FINISHED"}:
        raise RuntimeError("Mantaflow did not finish")
    seen = [extent(bpy, scene, domain, number) for number in config["frames"]]
    bpy.ops.wm.save_as_mainfile(filepath=config["blend"])
    # renamed when complete: its existence marks a finished simulation
    with open(config["baked"] + ".part", "w", encoding="utf-8") as file:
        json.dump(seen, file)
    os.replace(config["baked"] + ".part", config["baked"])


def add_fire(bpy, physics: dict, draw: random.Random) -> None:
    """Add the balls of fuel: evenly spread directions, random distances and amounts."""
    radius, grows = physics["radius"], physics["grows"]
    number = physics["lobes"]
    for i in range(number):
        height = 0.95 * (i + 0.3) / number
        azimuth = i * GOLDEN_ANGLE + draw.uniform(-0.3, 0.3)
        across = math.sqrt(1.0 - height * height)
        out = across * math.cos(azimuth), across * math.sin(azimuth), height
        far = radius * draw.uniform(0.52, 0.85)
        add_flow(
            bpy,
            start=[0.12 * radius * c for c in out],
            end=[far * c for c in out],
            sizes=(0.12 * radius, radius * draw.uniform(0.2, 0.36)),
            frames=(1, grows),
            fuel=physics["fuel"] * draw.uniform(0.6, 1.3),
            density=physics["soot"] * draw.uniform(0.5, 1.5),
            temperature=physics["heat"] * draw.uniform(0.6, 1.3),
            colour=SOOT,
            speed=physics["speed"],
        )
    add_flow(
        bpy,
        start=[0.0, 0.0, 0.0],
        end=[0.0, 0.0, 0.15 * radius],
        sizes=(0.2 * radius, 0.55 * radius),
        frames=(1, grows),
        fuel=physics["fuel"],
        density=physics["soot"],
        temperature=physics["heat"],
        colour=SOOT,
        speed=0.25 * physics["speed"],
    )


def add_dust(bpy, physics: dict, draw: random.Random) -> None:
    """Add puffs of dust that move outwards over the ground."""
    radius, number = physics["radius"], physics["puffs"]
    for i in range(number):
        azimuth = 2.0 * math.pi * (i + draw.uniform(-0.3, 0.3)) / number
        out = math.cos(azimuth), math.sin(azimuth)
        far = radius * draw.uniform(0.95, 1.4)
        add_flow(
            bpy,
            start=[0.4 * radius * c for c in out] + [0.0],
            end=[far * c for c in out] + [0.02],
            sizes=(0.08 * radius, radius * draw.uniform(0.06, 0.13)),
            frames=(2, 2 + 3 * physics["grows"]),
            fuel=0.0,
            density=physics["dust"] * draw.uniform(0.6, 1.4),
            temperature=0.03,
            colour=DUST,
            speed=0.2,
        )


def add_flow(
    bpy, *, start, end, sizes, frames, fuel, density, temperature, colour, speed
) -> None:
    """Add a ball that moves from start to end, slowing down, and emits gas."""
    first, count = frames
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=1.0, location=start)
    ball = bpy.context.object
    # exponential approach with three time constants, normalised to end exactly at `end`
    for k in range(count + 1):
        share = (1.0 - math.exp(-3.0 * k / count)) / (1.0 - math.exp(-3.0))
        ball.location = [a + (b - a) * share for a, b in zip(start, end, strict=True)]
        ball.keyframe_insert("location", frame=first + k)
        size = sizes[0] + (sizes[1] - sizes[0]) * share
        ball.scale = size, size, size
        ball.keyframe_insert("scale", frame=first + k)
    modifier = ball.modifiers.new("gas", "FLUID")
    modifier.fluid_type = "FLOW"
    flow = modifier.flow_settings
    flow.flow_type = "BOTH" if fuel else "SMOKE"
    flow.flow_behavior = "INFLOW"
    flow.fuel_amount, flow.density, flow.temperature = fuel, density, temperature
    flow.smoke_color = colour
    flow.use_initial_velocity = True
    flow.velocity_factor, flow.velocity_normal = 1.0, speed
    flow.surface_distance, flow.subframes = 0.5, 1
    # keyframes switch the flow on and off at whole frames
    for frame, flows in ((first - 1, first == 1), (first, True), (first + count, True)):
        flow.use_inflow = flows
        flow.keyframe_insert("use_inflow", frame=frame)
    flow.use_inflow = False
    flow.keyframe_insert("use_inflow", frame=first + count + 1)


def add_domain(bpy, physics: dict, cache: str):
    """Add the simulated box: closed by the ground below, open elsewhere."""
    width, height = physics["width"], physics["height"]
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, height / 2))
    domain = bpy.context.object
    domain.name = "domain"
    domain.scale = width, width, height
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    modifier = domain.modifiers.new("gas", "FLUID")
    modifier.fluid_type = "DOMAIN"
    settings = modifier.domain_settings
    settings.domain_type = "GAS"
    settings.resolution_max = physics["resolution"]
    settings.cache_directory, settings.cache_type = cache, "ALL"
    settings.cache_frame_start, settings.cache_frame_end = 1, physics["last"]
    settings.cache_data_format = "OPENVDB"
    # the ground; the other sides are open, so that gas can leave
    settings.use_collision_border_bottom = True
    for side in ("front", "back", "left", "right", "top"):
        setattr(settings, f"use_collision_border_{side}", False)
    settings.use_noise = physics["noise"] > 0
    settings.noise_scale, settings.noise_strength = 2, physics["noise"]
    settings.alpha, settings.beta = 0.0, physics["buoyancy"]
    settings.vorticity = physics["vorticity"]
    settings.burning_rate = physics["burning_rate"]
    settings.flame_smoke = physics["flame_smoke"]
    settings.flame_vorticity = physics["flame_vorticity"]
    settings.flame_ignition, settings.flame_max_temp = 1.2, 4.0
    settings.flame_smoke_color = SOOT
    # fast gas at the start needs shorter steps than the frames
    settings.use_adaptive_timesteps = True
    settings.cfl_condition, settings.timesteps_max = 4.0, 4
    return domain


def extent(bpy, scene, domain, number: int) -> dict:
    """Return the heat of a frame and its extent [Blender's metre]."""
    scene.frame_set(number)
    graph = bpy.context.evaluated_depsgraph_get()
    settings = domain.evaluated_get(graph).modifiers[0].domain_settings
    nx, ny, nz = settings.domain_resolution
    density, heat = settings.density_grid, list(settings.heat_grid)[::3]
    # 90th percentile of warm cells: single hot cells do not set the scale of heat
    warm = sorted(value for value in heat if value > VISIBLE)
    hot = warm[int(0.9 * len(warm))] if warm else 1.0
    cell, reach, top = domain.dimensions[0] / nx, 0.0, 0.0
    if len(density) != nx * ny * nz:  # the grid of noise is twice as fine
        nx, ny, nz, cell = 2 * nx, 2 * ny, 2 * nz, cell / 2
    density = list(density)
    for k in range(nz):
        layer = density[k * nx * ny : (k + 1) * nx * ny]
        if max(layer) < VISIBLE:
            continue
        top = (k + 1) * cell
        for j in range(0, ny, 2):
            row = layer[j * nx : (j + 1) * nx]
            if max(row) < VISIBLE:
                continue
            across = (j + 0.5 - ny / 2) * cell
            for i in (i for i, value in enumerate(row) if value >= VISIBLE):
                reach = max(reach, math.hypot((i + 0.5 - nx / 2) * cell, across))
    return {"frame": number, "hot": hot, "reach": reach, "top": top}


if __name__ == "__main__":
    main()
