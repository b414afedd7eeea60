"""Partners one to one, by the least sum of what each pair costs, without half a second of imports."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix


def least_assignment(cost: Matrix) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns of the pairs whose costs have the least sum: one for each row, or for each column.

    It does what SciPy's ``optimize.linear_sum_assignment`` does.

    Parameters
    ----------
    cost
        Finite costs of all pairs, shape (rows, columns).

    Raises
    ------
    ValueError
        A cost is not finite.
    """
    if not np.isfinite(cost).all():
        raise ValueError("a cost of a pair is not finite")
    # a sparse matrix keeps no zeros: all are lifted by as much, which no sum of as many pairs sees
    lifted = sp.csr_array(cost - cost.min(initial=0.0) + 1.0)
    rows, columns = sp.csgraph.min_weight_full_bipartite_matching(lifted)
    return rows.astype(np.int64), columns.astype(np.int64)
