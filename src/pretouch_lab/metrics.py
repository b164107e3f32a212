"""Small measures shared by the experiments."""

import numpy as np

from pretouch.types import FloatArray


def rounded(value: float, digits: int = 3) -> float:
    """Round for a table; what is dropped is far below any error of the measure."""
    return round(float(value), digits)


def peak(values: FloatArray) -> float:
    """Largest value, 0 of none."""
    return float(values.max(initial=0.0))


def angle_deg(a: FloatArray, b: FloatArray) -> float | None:
    """Angle between two vectors (3,) [deg], None if one of them is zero."""
    sizes = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(a @ b / sizes, -1.0, 1.0)))) if sizes > 0 else None


def spread(values: list[float]) -> dict[str, float | int] | None:
    """Median and 10-90 % of some numbers, None of none."""
    if not values:
        return None
    low, middle, high = np.percentile(values, [10, 50, 90])
    return {"median": rounded(middle, 4), "p10": rounded(low, 4), "p90": rounded(high, 4), "n": len(values)}
