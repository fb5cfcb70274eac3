"""The same fit for thousands to millions of logs."""

from jblast.inference.many.fit_many import ManyFits as ManyFits, fit_many as fit_many
from jblast.inference.many.solver import (
    LaneLevenbergMarquardt as LaneLevenbergMarquardt,
)
