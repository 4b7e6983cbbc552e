"""Plain data for a JSON file or line."""

import math
from typing import Any


def finite(value: Any) -> Any:
    """Plain data as JSON knows it: numpy's numbers and arrays as lists, what is not finite null."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
