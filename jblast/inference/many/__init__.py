"""The same fit for thousands to millions of logs."""

from jblast.inference.many.fit_many import fit_many as fit_many
from jblast.inference.many.many_fits import ManyFits as ManyFits
from jblast.inference.many.solver.levenberg_marquardt import (
    LaneLevenbergMarquardt as LaneLevenbergMarquardt,
)
