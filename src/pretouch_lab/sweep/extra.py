"""What sweeps need beside the package itself: the extra `sweep`."""

from importlib.util import find_spec

from pretouch.errors import ExperimentError

_NEEDED = {"SALib": "indices", "pyarrow": "tables"}


def check_extra(cluster: bool = False) -> None:
    """Raise ExperimentError where the extra is not installed."""
    wanted = [*_NEEDED, *(["distributed"] if cluster else [])]
    missing = [name for name in wanted if find_spec(name) is None]
    if missing:
        raise ExperimentError(f"Sweeps need {', '.join(missing)}: pip install 'pretouch-lab[sweep]'.")
