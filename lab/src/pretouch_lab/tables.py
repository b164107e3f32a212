"""How values of rows are written in the tables of benchmarks."""

from collections.abc import Callable

from pretouch_lab.run import Row


def plain(key: str, written: str = "", factor: float | None = None) -> Callable[[Row], str]:
    """Write a row's value in a format, times a factor if one is given."""
    return lambda row: format(row[key] if factor is None else factor * row[key], written)


def share(key: str, whole: str = "trials", between: str = "/") -> Callable[[Row], str]:
    """Write how many of a row's trials, or of another number of it."""
    return lambda row: f"{row[key]}{between}{row[whole]}"


def with_spread(value: Row | None, digits: int, factor: float = 1.0) -> str:
    """Write the median of a spread with its 10-90 % below, these with fewer digits where they are large."""
    if value is None:
        return "-"
    few = 0 if factor * value["p90"] >= 10 else min(digits, 2)
    return f"{factor * value['median']:.{digits}f}\n{factor * value['p10']:.{few}f}-{factor * value['p90']:.{few}f}"
