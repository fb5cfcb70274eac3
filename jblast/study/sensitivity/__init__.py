"""What an outcome's scatter comes from: shares of its variance, and slopes."""

from jblast.study.sensitivity.elasticity import (
    elasticities as elasticities,
    fitted_slopes as fitted_slopes,
)
from jblast.study.sensitivity.indices import (
    MOST_ROWS as MOST_ROWS,
    SobolIndices as SobolIndices,
    disagreement as disagreement,
    indices_from_samples as indices_from_samples,
    indices_of_function as indices_of_function,
)
