"""What `jblast serve` does until it is stopped."""

import asyncio
import contextlib
import gc
import signal
import sys

from jblast.errors import InputError, read_text
from jblast.report.world import ServedAnswer, served_answer, serving_line
from jblast.world import DrawnWorld
from jblast.world.remote.serving import Options, listening

USUAL = (700, 10, 10)
"""How often Python collects by itself."""


def served(world: DrawnWorld, options: Options) -> ServedAnswer:
    """Serve until SIGINT or SIGTERM comes; return what came of it.

    Raises:
        InputError: As in `listening`.
    """
    return asyncio.run(_served(world, options))


async def _served(world: DrawnWorld, options: Options) -> ServedAnswer:
    # a command that ends soon need not collect (`start_jax`); this one does not end
    gc.freeze()
    gc.set_threshold(*USUAL)
    over = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError, ValueError):
            loop.add_signal_handler(number, over.set)
    async with listening(world, options, _say) as server:
        _say(serving_line(world, server.address, options))
        await over.wait()
    return served_answer(server)


def token_of(said: str) -> str:
    """Return the token that was said, or that a file holds.

    Raises:
        InputError: The file cannot be read, or the token has a blank in it.
    """
    if said.startswith("@"):
        said = read_text(said[1:], "a file with the token").strip()
        if not said:
            raise InputError("--token: expected a file with a word, got an empty one")
    if not (said.isascii() and said.isprintable()) or " " in said:
        raise InputError("--token: expected a word without blanks, of ASCII")
    return said


def _say(line: str) -> None:
    sys.stderr.write(f"jblast serve: {line}\n")
    sys.stderr.flush()
