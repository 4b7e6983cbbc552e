"""What all tests share: one thread of BLAS each, and the long files first."""

import os

# Two workers on two cores: products here are small, and a second thread only waits for the first.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_collection_modifyitems(items):
    """Files with slow tests begin, so that no core is left with one of them at the end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
