"""Rendering of every view of a baked explosion, run by Blender.

    blender -b BAKED.blend --factory-startup --python SCRIPT -- CONFIG.json

A picture is rendered twice, into two uncompressed OpenEXR files of single precision:
0000.glow.exr and 0000.shade.exr in the view's folder. `glow`: the gas emits and
absorbs, so that light over alpha is a measure of the heat along a ray; only the start
of the steps along it is random. `shade`: the gas scatters and absorbs the light of sky
and sun. Existing pictures are not rendered again.
"""

import contextlib
import ctypes
import json
import math
import os
import sys

AWAY, FARTHEST = 20.0, 100.0
"""Distance of the camera, and its clipping distance [Blender's metre]."""
LAYERS = ("glow", "shade")
VIEWS_PER_FRAME = 16
"""Views that are rendered frame by frame. Loading a frame takes longer than rendering
a picture, so more views are faster; a view is finished only when all its frames are,
so fewer views lose less on interruption."""
EYE = "eye_"
"""Prefix of our names among the render views of a scene, which has two of its own."""


def main() -> None:
    """Set the scene once, then render the missing pictures."""
    # PR_SET_PDEATHSIG: Blender ends with the process that started it (Linux only).
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(1, 9, 0, 0, 0)
    with open(sys.argv[sys.argv.index("--") + 1], encoding="utf-8") as file:
        config = json.load(file)
    import bpy  # type: ignore (Blender's own)
    from mathutils import Vector  # type: ignore

    scene, domain = bpy.context.scene, bpy.data.objects["domain"]
    for thing in bpy.data.objects:
        # the emitters are meshes, which would be rendered as solids
        thing.hide_render = thing.name != domain.name
    materials, inputs = set_materials(bpy, domain, config)
    set_light(bpy, scene, config["light"], Vector)
    set_output(scene, config)
    cameras = [add_camera(bpy, scene, number) for number in range(VIEWS_PER_FRAME)]
    scene.camera = cameras[0]
    for first in range(0, len(config["views"]), VIEWS_PER_FRAME):
        views = config["views"][first : first + VIEWS_PER_FRAME]
        # layer outside, frames inside: changing the material prepares the scene again
        for layer in LAYERS:
            domain.data.materials[0] = materials[layer]
            scene.cycles.samples = config["samples"][layer]
            for number, frame in enumerate(config["frames"]):
                # resumed after an interruption: only pictures without a file
                missing = [
                    (view, path)
                    for view in views
                    if not os.path.exists(
                        path := picture(view["folder"], number, layer)
                    )
                ]
                if not missing:
                    continue
                scene.frame_set(frame["frame"])
                for name, sockets in inputs.items():
                    for socket in sockets:
                        socket.default_value = frame[name]
                for camera, (view, _) in zip(cameras, missing, strict=False):
                    aim(camera, view, frame["scale"])
                render(bpy, scene, [path for _, path in missing])


def render(bpy, scene, paths: list[str]) -> None:
    """Render one picture per camera, and rename each when it is complete.

    All are rendered together as one multi-view picture, so that the gas is loaded and
    prepared once.
    """
    eyes = [eye for eye in scene.render.views if eye.name.startswith(EYE)]
    for number, eye in enumerate(eyes):
        eye.use = number < len(paths)
    # a single view is rendered without multi-view, whose files have suffixes
    several = len(paths) > 1
    scene.render.use_multiview = several
    scene.render.filepath = os.path.join(os.path.dirname(paths[0]), "part.exr")
    bpy.ops.render.render(write_still=True)
    stem = scene.render.filepath.removesuffix(".exr")
    for eye, path in zip(eyes, paths, strict=False):
        os.replace(f"{stem}{eye.file_suffix if several else ''}.exr", path)


def add_camera(bpy, scene, number: int):
    """Add a camera, and the render view that uses it."""
    lens = bpy.data.cameras.new(f"camera_{number}")
    # orthographic: the scale of a picture does not depend on depth
    lens.type, lens.clip_end = "ORTHO", FARTHEST
    camera = bpy.data.objects.new(lens.name, lens)
    scene.collection.objects.link(camera)
    eye = scene.render.views.new(f"{EYE}{number}")
    eye.camera_suffix = eye.file_suffix = f"_{number}"
    return camera


def picture(folder: str, number: int, layer: str) -> str:
    """Return the path of a picture, and create its folder."""
    os.makedirs(folder, exist_ok=True)
    return os.path.join(folder, f"{number:04d}.{layer}.exr")


def aim(camera, view: dict, scale: float) -> None:
    """Point a level camera at the burst, which is below the picture's middle."""
    azimuth, elevation = (math.radians(view[k]) for k in ("azimuth", "elevation"))
    camera.location = (
        AWAY * math.sin(azimuth) * math.cos(elevation),
        AWAY * math.cos(azimuth) * math.cos(elevation),
        AWAY * math.sin(elevation),
    )
    camera.rotation_euler = (math.pi / 2 - elevation, 0.0, math.pi - azimuth)
    camera.data.ortho_scale = scale
    camera.data.shift_y = view["anchor"] - 0.5  # of the picture's side, downwards


def set_output(scene, config: dict) -> None:
    """Set the options of rendering and of output files."""
    cycles, render, image = scene.cycles, scene.render, scene.render.image_settings
    render.engine = "CYCLES"
    cycles.device, cycles.use_denoising = "CPU", False
    cycles.use_adaptive_sampling = False
    # single scattering: the strength of sky and sun (`bake.LIGHT`) is chosen for it
    cycles.max_bounces = cycles.volume_bounces = 0
    cycles.volume_max_steps = 512
    render.film_transparent, render.use_persistent_data = True, True
    render.resolution_x = render.resolution_y = config["size"]
    render.resolution_percentage = 100
    image.file_format, image.exr_codec = "OPEN_EXR", "NONE"
    image.color_mode, image.color_depth = "RGBA", "32"
    render.views_format, image.views_format = "MULTIVIEW", "INDIVIDUAL"
    # Blender's own left and right views stay off
    for eye in render.views:
        eye.use = False
    render.use_file_extension = True


def set_light(bpy, scene, light: dict, Vector) -> None:
    """Add a white sky and a sun."""
    world = bpy.data.worlds.new("sky")
    scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"].inputs
    background[0].default_value = (1.0, 1.0, 1.0, 1.0)
    background[1].default_value = light["sky"]
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.angle = light["sun"], 0.01
    thing = bpy.data.objects.new("sun", sun)
    thing.rotation_euler = Vector(light["towards"]).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(thing)


def set_materials(bpy, domain, config: dict) -> tuple[dict, dict]:
    """Return the material of each layer, and their inputs that change by frame."""
    inputs: dict[str, list] = {"hot": [], "fade": [], "extinction": []}
    made = {n: material(bpy, n, config["look"], inputs) for n in LAYERS}
    domain.data.materials.clear()
    domain.data.materials.append(made["glow"])
    return made, inputs


def material(bpy, name: str, look: dict, inputs: dict):
    """Return a material that glows and absorbs, or one that scatters and absorbs."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.cycles.volume_sampling = "DISTANCE"
    made.cycles.volume_step_rate = look["step"][name]
    tree = made.node_tree
    tree.nodes.clear()

    def grid(attribute, output="Fac"):
        node = tree.nodes.new("ShaderNodeAttribute")
        node.attribute_name = attribute
        return node.outputs[output]

    def value(key):
        node = tree.nodes.new("ShaderNodeValue")
        inputs[key].append(node.outputs[0])
        return node.outputs[0]

    def calculated(operation, *operands, clamp=False):
        node = tree.nodes.new("ShaderNodeMath")
        node.operation, node.use_clamp = operation, clamp
        for socket, operand in zip(node.inputs, operands, strict=False):
            if isinstance(operand, float):
                socket.default_value = operand
            else:
                tree.links.new(operand, socket)
        return node.outputs[0]

    def added(first, second):
        node = tree.nodes.new("ShaderNodeAddShader")
        tree.links.new(first, node.inputs[0])
        tree.links.new(second, node.inputs[1])
        return node.outputs[0]

    def shader(kind, colour, **sockets):
        node = tree.nodes.new(kind)
        for key, socket in sockets.items():
            tree.links.new(socket, node.inputs[key])
        if isinstance(colour, tuple):
            node.inputs["Color"].default_value = colour
        else:
            tree.links.new(colour, node.inputs["Color"])
        return node.outputs[0]

    extinction = calculated("MULTIPLY", grid("density"), value("extinction"))
    if name == "glow":
        # relative to the frame's own hot gas: the simulation's unit has no meaning
        share = calculated("DIVIDE", grid("heat"), value("hot"), clamp=True)
        heat = calculated("POWER", share, look["contrast"])
        heat = calculated("MULTIPLY", heat, value("fade"))
        # a black body's light by Wien's law, which the reader of the file inverts
        span, air, reference = look["span_k"], look["air_k"], look["reference_k"]
        warmth = calculated("ADD", calculated("MULTIPLY", heat, span), air)
        exponent = calculated("SUBTRACT", 1.0, calculated("DIVIDE", reference, warmth))
        source = calculated("EXPONENT", calculated("MULTIPLY", exponent, look["wien"]))
        strength = calculated("MULTIPLY", extinction, source)
        white, black = (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)
        emission = shader("ShaderNodeEmission", white, Strength=strength)
        lost = shader("ShaderNodeVolumeAbsorption", black, Density=extinction)
        volume = added(emission, lost)
    else:
        colour = grid("color", "Color")
        kept = shader("ShaderNodeVolumeScatter", colour, Density=extinction)
        lost = shader("ShaderNodeVolumeAbsorption", colour, Density=extinction)
        volume = added(kept, lost)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(volume, output.inputs["Volume"])
    return made


if __name__ == "__main__":
    main()
