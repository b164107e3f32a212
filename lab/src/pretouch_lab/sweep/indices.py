"""How much each parameter matters: Sobol indices, rank correlations, or the course over a grid, with 95 % intervals."""

import numpy as np

from pretouch.types import FloatArray
from pretouch_lab.rows import Row, rounded
from pretouch_lab.sweep.definition import Sweep
from pretouch_lab.sweep.design import SEED, columns, problem
from pretouch_lab.sweep.results import values_of
from pretouch_lab.sweep.run import Run

LEVEL = 0.95
_RESAMPLES = 500
_DRAWN_WITH = 2021
_FLAT = 1e-9
"""Spread of a number, as a part of its size, below which it does not vary."""


def indices(run: Run) -> Row:
    """Return what there is to say of each metric: a list of rows by its name, and how many points it rests on."""
    sweep, found = run.sweep, {}
    for metric in sweep.metrics:
        values = values_of(run, metric)
        if sweep.design == "sobol":
            found[metric] = sobol_indices(sweep, values, metric in sweep.ranks)
        elif sweep.design == "lhs":
            found[metric] = _correlations(run, values)
        else:
            found[metric] = _courses(run, values)
    return found


def sobol_indices(sweep: Sweep, values: FloatArray, ranked: bool = False) -> Row:
    """First-order and total index of each column, from values (samples * (D + 2),) in the order of the design.

    A block in which a value is missing is left out whole, for its differences are what the indices are made of. With
    `ranked` the indices are those of the values' ranks.
    """
    from SALib.analyze import sobol
    from scipy.stats import rankdata

    wanted = columns(sweep)
    blocks = values.reshape(-1, len(wanted) + 2)
    whole = blocks[np.isfinite(blocks).all(axis=1)]
    about: Row = {"blocks": len(whole), "of": len(blocks), **_spread(whole[:, [0, -1]].ravel())}
    if len(whole) < 2 or np.ptp(whole) <= _FLAT * np.abs(whole).max():
        return about | {"rows": []}
    if ranked:
        whole = rankdata(whole).reshape(whole.shape)
    made = sobol.analyze(
        problem(wanted), whole.ravel(), calc_second_order=False, num_resamples=_RESAMPLES, conf_level=LEVEL,
        seed=_DRAWN_WITH,
    )  # fmt: skip
    rows = [
        {
            "parameter": one.name, "first": rounded(made["S1"][i], 4), "first_95": rounded(made["S1_conf"][i], 4),
            "total": rounded(made["ST"][i], 4), "total_95": rounded(made["ST_conf"][i], 4),
        }
        for i, one in enumerate(wanted)
    ]  # fmt: skip
    return about | {"rows": rows}


def _correlations(run: Run, values: FloatArray) -> Row:
    """Spearman's rank correlation of each column with the values; of a choice, of its number in the list."""
    from scipy.stats import norm, rankdata

    known = np.isfinite(values)
    about: Row = {"points": int(known.sum()), "of": len(values), **_spread(values[known])}
    if known.sum() < 4 or np.ptp(values[known]) == 0.0:
        return about | {"rows": []}
    ranks, rows = rankdata(values[known]), []
    reach = float(norm.ppf(0.5 + LEVEL / 2) / np.sqrt(known.sum() - 3))  # Fisher's z
    for one in columns(run.sweep):
        column = [point.seed if one.name == SEED else point.values[one.name] for point in run.points]
        place = [float(one.choices.index(v)) if one.choices else float(v) for v in column]
        given = rankdata(np.array(place)[known])
        r = float(np.corrcoef(given, ranks)[0, 1]) if np.ptp(given) else 0.0
        z = np.arctanh(np.clip(r, -0.999999, 0.999999))
        rows.append({
            "parameter": one.name, "correlation": rounded(r, 4),
            "low": rounded(np.tanh(z - reach), 4), "high": rounded(np.tanh(z + reach), 4),
        })  # fmt: skip
    return about | {"rows": rows}


def _courses(run: Run, values: FloatArray) -> Row:
    """Mean, median and 10 to 90 % at each level of each parameter, over all else."""
    rows = []
    for one in run.sweep.vary:
        for level in one.grid():
            here = np.array([v for p, v in zip(run.points, values, strict=True) if p.values[one.name] == level])
            here = here[np.isfinite(here)]
            rows.append({"parameter": one.name, "level": level, "n": len(here), **_spread(here)})
    known = np.isfinite(values)
    return {"points": int(known.sum()), "of": len(values), **_spread(values[known]), "rows": rows}


def _spread(values: FloatArray) -> Row:
    """Mean, median and 10 to 90 % of some values, None of none."""
    if not len(values):
        return dict.fromkeys(("mean", "median", "p10", "p90"))
    low, middle, high = np.percentile(values, [10, 50, 90])
    numbers = {"mean": values.mean(), "median": middle, "p10": low, "p90": high}
    return {name: rounded(value, 4) for name, value in numbers.items()}
