"""A program for one row of one log, run over arrays of rows and lanes."""

from jblast.inference.many.residuals.fold.cells import (
    CannotFoldError as CannotFoldError,
    Cell as Cell,
)
from jblast.inference.many.residuals.fold.interpreter import (
    fold as fold,
    over_cells as over_cells,
)
