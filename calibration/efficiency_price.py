r"""What insurance against wild readings costs on a log that has none.

Normal errors are fitted as Student-t. A fit of many readings by the score
$\psi(u) = (\nu + 1) u/(\nu + u^2)$ has the variance
$\mathrm{E}\psi^2/(\mathrm{E}\psi')^2$ (Huber 1964, Ann. Math. Stat. 35:73) where least
squares has 1. With $h = \mathrm{E}\,1/(\nu + u^2)$ for a normal $u$, integrated by
parts, its root is
$$\sqrt{((\nu + 1) h - 1)/2}\,/\,(1 - \nu h), \qquad
h = \sqrt{\pi/2\nu}\;e^{\nu/2}\,\mathrm{erfc}\sqrt{\nu/2}$$
Few readings cost less: a residual that the unknowns fit away is in no tail.
"""

import numpy as np
from scipy.special import erfcx

from jblast.sensors.simulated_readings import STUDENT_FREEDOM


def price(freedom: float = STUDENT_FREEDOM) -> float:
    """Return the RMSE of many normal readings fitted as Student-t, in sds of the best.

    Args:
        freedom: Degrees of freedom of the Student-t.
    """
    h = np.sqrt(np.pi / (2 * freedom)) * erfcx(np.sqrt(freedom / 2))
    return float(np.sqrt(((freedom + 1) * h - 1) / 2) / (1 - freedom * h))
