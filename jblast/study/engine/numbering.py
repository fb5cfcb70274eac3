"""Which sample is which: variant of the scene, cell of the axes, draw.

Samples are counted from 0 to the end of the study. They come in blocks of one fixed
size, and each block is of one variant of the scene, variants taking turns; within a
variant the cells of the axes take turns. So whatever part of a study is there, it has
as many samples of each variant and cell, but for less than a block.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Int

FILLED = 2048
"""Down to this size blocks of several variants are smaller, so that fewer samples than
an eighth of what is asked fill up their last ones."""


class Numbering(NamedTuple):
    """How samples are counted.

    Attributes:
        block: Samples that a program takes together, a power of two.
        variants: Scenes that differ in more than numbers.
        cells: Combinations of the listed values of the axes.
        samples: In all.
        tile: Samples of a chunk of the store, the unit that is done or not: a power of
            two times the block.
    """

    block: int
    variants: int
    cells: int
    samples: int
    tile: int

    @property
    def tiles(self) -> int:
        """How many tiles there are; the last is filled up."""
        return -(-self.samples // self.tile)

    def blocks_of(self, tile: int) -> Int[np.ndarray, " block"]:
        """Return the numbers of a tile's blocks."""
        each = self.tile // self.block
        last = -(-self.samples // self.block)
        return np.arange(tile * each, min((tile + 1) * each, last), dtype=np.int64)

    def variant_of(self, blocks: Int[np.ndarray, "..."]) -> Int[np.ndarray, "..."]:
        """Return the variant of each block."""
        return blocks % self.variants

    def begins_at(self, blocks: Int[np.ndarray, "..."]) -> Int[np.ndarray, "..."]:
        """Return the first number of each block among those of its variant."""
        return blocks // self.variants * self.block

    def of_samples(
        self, begin: int, end: int
    ) -> tuple[Int[np.ndarray, " sample"], Int[np.ndarray, " sample"]]:
        """Return variant and cell of samples."""
        index = np.arange(begin, end, dtype=np.int64)
        blocks = index // self.block
        within = self.begins_at(blocks) + index % self.block
        return self.variant_of(blocks), within % self.cells


def numbered(
    draws: int, cells: int, variants: int, *, block: int, tile_samples: int
) -> Numbering:
    """Return how the samples of a study are counted.

    Args:
        draws: Samples of each cell of each variant; of several variants at least so
            many: they are filled up to whole blocks.
        cells: Combinations of the listed values of the axes.
        variants: Scenes that differ in more than numbers.
        block: The most that a program takes together, a power of two.
        tile_samples: The most that a chunk of the store should hold.
    """
    each = draws * cells
    block = min(block, 1 << (each - 1).bit_length())
    while variants > 1 and block > FILLED and -each % block > each / 8:
        block //= 2
    samples = each if variants == 1 else variants * block * -(-each // block)
    tile = block
    while 2 * tile <= min(tile_samples, samples):
        tile *= 2
    return Numbering(block, variants, cells, samples, tile)
