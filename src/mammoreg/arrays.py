"""Kinds of arrays; what their axes mean stands in each docstring."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""Numbers in double precision."""
Floats32 = NDArray[np.float32]
"""Samples of images and volumes."""
Integers = NDArray[np.int64]
"""Numbers of nodes, elements and faces."""
Bools = NDArray[np.bool_]
"""Masks and choices."""
Points = NDArray[np.float64]
"""Positions (..., 3) or one of them (3,), mm."""
