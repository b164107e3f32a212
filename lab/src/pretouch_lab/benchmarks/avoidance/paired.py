"""Baselines held against a reference on the same seeds, trials without a contact or an end included."""

import numpy as np

from pretouch_lab.run import Row
from pretouch_lab.table import finite, grouped, median_bounds

FORCES = ("peak_estimate_n", "true_peak_20ms_n", "clamping_force_n")
TIMES = ("first_contact_s", "cycle_time_s")
FAMILIES = ("static", "person")
"""Families the goals are about."""
REFERENCES = ("blind", "paper", "paper-off")


def paired(rows: list[Row]) -> list[Row]:
    """Return for each baseline and reference the median part of the reference's measure that the baseline has.

    A family's scenarios and seeds count together, with 95 % bounds on the median. A force counts where the reference
    touched; a baseline without contact has none of it. A time counts where either came to an end; what did not is
    infinite, in the result None.
    """
    found = []
    for key, group in grouped([row for row in rows if row["family"] in FAMILIES], ("family", "contender")):
        for reference in REFERENCES:
            pairs = _pairs(rows, group, reference)
            for measure in (*FORCES, *TIMES):
                parts = [part for theirs, mine in pairs if (part := _part(theirs, mine, measure)) is not None]
                if parts and key["contender"] != reference:
                    low, high = median_bounds(parts)
                    middle = np.percentile(parts, 50, method="higher")  # of an infinite value no mean is taken
                    found.append({
                        **key, "reference": reference, "measure": measure, "trials": len(parts),
                        "part": finite(middle), "low": finite(low), "high": finite(high),
                    })  # fmt: skip
    return found


def _pairs(rows: list[Row], group: list[Row], reference: str) -> list[tuple[Row, Row]]:
    of = {(row["scenario"], row["seed"]): row for row in rows if row["contender"] == reference}
    return [(of[where], row) for row in group if (where := (row["scenario"], row["seed"])) in of]


def _part(theirs: Row, mine: Row, measure: str) -> float | None:
    """Return the baseline's measure by the reference's; None where it does not count."""
    if measure in FORCES:
        return (mine[measure] or 0.0) / theirs[measure] if theirs["contact"] and theirs[measure] else None
    if measure == "cycle_time_s" and not mine["timed"]:
        return None
    if mine[measure] is None:
        return None if theirs[measure] is None else np.inf
    return 0.0 if theirs[measure] is None else mine[measure] / theirs[measure] if theirs[measure] else None
