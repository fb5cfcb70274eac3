"""The recording that a scene's ambient sound is a loop of, read from its file."""

from dataclasses import replace

import jax.numpy as jnp

from jblast.errors import InputError
from jblast.observations.records.sound import read_sound
from jblast.scene import Ambient, UncertainScene


def with_ambient(
    uncertain: UncertainScene, file: str | None = None
) -> tuple[UncertainScene, list[str]]:
    """Return a scene whose ambient recording has been read, and what to know of it.

    Args:
        uncertain: The scene. Its [ambient] may name a recording.
        file: A recording in place of what the scene says is heard; a sample of 1 in it
            is the scene's `full_scale_pa` of [ambient].

    Raises:
        InputError: The file cannot be used, see `read_sound`.
    """
    ambient = uncertain.scene.ambient
    if file is not None:
        said = ambient or Ambient()
        ambient = Ambient(file=file, height=said.height, full_scale=said.full_scale)
    if ambient is None or not ambient.file:
        return uncertain, []
    sound = read_sound(ambient.file)
    if (count := sound.samples.shape[1]) < 2:
        raise InputError(f"{ambient.file}: expected two samples or more, got {count}")
    notes = [f"ambient sound: a loop of {ambient.file}, {sound.seconds:g} s"]
    if len(sound.samples) > 1:
        notes.append(f"of its {len(sound.samples)} channels the first is heard")
    if 0 in sound.dead_channels:
        notes.append("the ambient recording is silent")
    loop = ambient.full_scale * jnp.asarray(sound.samples[0])
    ambient = replace(ambient, loop=loop, loop_rate=float(sound.rate_hz))
    return replace(uncertain, scene=replace(uncertain.scene, ambient=ambient)), notes
