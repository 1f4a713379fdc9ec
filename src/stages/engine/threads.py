"""One thread for every numerical library; called before NumPy is imported."""

import os

ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    # The same sums in the same order whatever the processor's other load.
    "MKL_CBWR": "COMPATIBLE",
}


def compute_with_one_thread() -> None:
    """Set the libraries' environment: several threads would sum in another order, and cores run jobs side by side."""
    os.environ.update(ONE_THREAD)
