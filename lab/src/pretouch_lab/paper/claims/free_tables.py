"""Tables of the experiments in which nothing touches the arm."""

from collections.abc import Callable

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.paper.claims.detectors import TABLE_I
from pretouch_lab.paper.claims.free_run import rate_text
from pretouch_lab.rows import Row
from pretouch_lab.tables import median, number, plain


def free_motion_tables(part: Row) -> list[TextTable]:
    """Show the estimate and its thresholds by speed, then what detectors took for contacts."""
    made = [_estimate(part), _sensitivity(part)]
    rates = part["false_detections"]
    return [*made, _moving(rates), _fixed(rates), _paths(part["by_trajectory"])] if rates else made


def _estimate(part: Row) -> TextTable:
    columns = (
        ("speed\n[m/s]", plain("speed_m_s", "g")),
        ("|offset|", lambda cell: "/".join(f"{value:.1f}" for value in cell["offset_n"])),
        ("std", lambda cell: _axes(cell["std_n"])),
        ("largest\ndeviation", lambda cell: "/".join(f"{value:.1f}" for value in cell["largest_deviation_n"])),
        (
            "norm 50/\n95/99 %",
            lambda cell: "/".join(number(cell[f"norm_{p}_n"], 1) for p in ("median", "p95", "p99")),
        ),
        ("norm\nmax", plain("norm_max_n", ".1f")),
        ("off path\n[mm]", median("path_rms_m", 1, 1000)),
    )
    return tabulated(
        "Force estimate of an arm that nothing touches, by speed: x/y/z [N]",
        columns,
        part["cells"],
        "Circle and line together. Offset: mean over the arms of its size, for its sign is another with each arm. Std:"
        " median. Largest deviation: from the offset of the trial, of all trials. Norm: of the whole estimate, offset"
        " included; medians of its percentiles, and the largest of all. Off path: median of the rms distance.",
    )


def _sensitivity(part: Row) -> TextTable:
    def narrower(axis: int) -> Callable[[Row], str]:
        return lambda cell: "-" if (value := cell["narrower_n"][axis]) is None else _range(value)

    columns = (
        ("speed\n[m/s]", plain("speed_m_s", "g")),
        ("F_sigma\nx/y/z", lambda cell: _axes(cell["f_sigma_n"], 2)),
        ("band\nx/y/z", lambda cell: _axes(cell["band_n"], 2)),
        *((f"narrower\n{axis}", narrower(k)) for k, axis in enumerate("xyz")),
    )
    return tabulated(
        "Sensitivity by speed: thresholds of an arm that nothing touches [N]",
        columns,
        part["cells"],
        "F_sigma: eq. 10. Band: F_b + F_sigma of eq. 9 at Table I's F_b, the force above the mean that makes a"
        " contact. Both: medians over the arms of the median in time. Narrower: by how much the band of the same arm"
        " on the same path is less than at the highest speed; median with 10-90 % below.",
    )


def _moving(rates: list[Row]) -> TextTable:
    def at(force: float) -> Callable[[tuple[str, bool]], str]:
        return lambda kind: rate_text(_find(rates, kind[0], force, kind[1]))

    moving = [rate for rate in rates if rate["detector"] != "fixed"]
    columns = (
        ("detector", lambda kind: kind[0]),
        ("objects", lambda kind: "near" if kind[1] else "far"),
        *((f"{force:g} N", at(force)) for force in sorted({rate["force_n"] for rate in moving})),
    )
    return tabulated(
        f"False detections per hour in {rates[0]['hours']:.2g} hours of motion, by F_b",
        columns,
        dict.fromkeys((rate["detector"], rate["near"]) for rate in moving),
        "With 95 % bounds below, which count the arms' differences. Filtered: the value of eq. 8 is compared. Alpha"
        " 0.3: the same with a quicker filter than Table I's 0.1. Raw: the estimate itself, as in the authors' code;"
        " raw twice: two samples in a row. Far: F_obs is 0. Near: it is F_d = 4 N on both sides of each axis, so that"
        " near is far with 4 N less. Each detection is answered for 2 s: 1800 an hour is the most there can be.",
    )


def _fixed(rates: list[Row]) -> TextTable:
    shown = [rate for rate in rates if rate["detector"] == "fixed"]
    return TextTable(
        f"False detections per hour of a fixed threshold in {rates[0]['hours']:.2g} hours of motion",
        ("detector", *(f"{rate['force_n']:g} N" for rate in shown)),
        (("fixed", *map(rate_text, shown)),),
        "The estimate of each axis is held against a force, without window, mean and F_sigma. With 95 % bounds below.",
    )


def _paths(parts: list[Row]) -> TextTable:
    f_base = TABLE_I.f_base_n

    def by(detector: str) -> Callable[[Row], str]:
        return lambda part: rate_text(_find(part["false_detections"], detector, f_base, True))

    columns = (
        ("path", plain("trajectory")),
        ("F_sigma\nx/y/z", lambda part: _axes(part["cells"][-1]["f_sigma_n"], 2)),
        ("narrower\nx/y/z", lambda part: _axes(part["cells"][0]["narrower_n"], 2)),
        *((detector, by(detector)) for detector in ("filtered", "alpha 0.3", "raw", "raw twice")),
    )
    return tabulated(
        f"What the path changes: F_sigma, and false detections per hour at F_b {f_base:g} N near objects",
        columns,
        parts,
        "F_sigma: at the highest speed [N]. Narrower: by how much it is less at the lowest [N]. The line turns back"
        " at both ends at once, the circle never does: it is at turns that friction makes forces of nothing.",
    )


def noise_tables(part: Row) -> list[TextTable]:
    """Show what noise does to the estimate and to F_sigma, then to each detector."""
    return [_noise(part), _noise_rates(part)]


def _noise(part: Row) -> TextTable:
    columns = (
        ("noise\nfactor", plain("noise_factor", "g")),
        ("std\n[N]", lambda cell: _axes(cell["std_n"])),
        ("F_sigma\n[N]", lambda cell: _axes(cell["f_sigma_n"], 2)),
        ("at F_std\n[%]", lambda cell: "/".join(f"{100 * value:.0f}" for value in cell["f_sigma_capped"])),
    )
    return tabulated(
        "Robustness to noise: the estimate of an arm that nothing touches, x/y/z",
        columns,
        part["cells"],
        "On the circle at 0.3 m/s. Factor: on the noise and ripple of the torque sensors and on the noise of the joint"
        " velocities. Std, F_sigma of eq. 10: medians. At F_std: part of the time in which sigma is sigma_max or more,"
        " so that F_sigma is its largest, F_std = 3 N, and the band widens no more with the noise.",
    )


def _noise_rates(part: Row) -> TextTable:
    def of(kind: tuple[str, float, bool]) -> Callable[[Row], str]:
        return lambda cell: rate_text(_find(cell["false_detections"], *kind))

    kinds = dict.fromkeys(_kind(rate) for cell in part["cells"] for rate in cell["false_detections"])
    return tabulated(
        "Robustness to noise: false detections per hour",
        (("noise\nfactor", plain("noise_factor", "g")), *((_heading(*kind), of(kind)) for kind in kinds)),
        part["cells"],
        "With 95 % bounds below, which count the arms' differences. Filtered: the paper's. No F_sigma: with F_std 0."
        " Raw: the estimate itself against the paper's thresholds. Far: F_obs is 0. Near: it is F_d = 4 N on both"
        " sides of each axis. Fixed: the estimate of each axis against a force, without a window. Each detection"
        " is answered for 2 s: 1800 an hour is the most there can be.",
    )


def _find(rates: list[Row], detector: str, force_n: float, near: bool) -> Row | None:
    """Return the rate of a detector with its setting, if it is there."""
    return next((rate for rate in rates if _kind(rate) == (detector, force_n, near)), None)


def _kind(rate: Row) -> tuple[str, float, bool]:
    return rate["detector"], rate["force_n"], rate["near"]


def _heading(detector: str, force_n: float, near: bool) -> str:
    return f"{detector}\n{force_n:g} N" if detector == "fixed" else f"{detector}\n{'near' if near else 'far'}"


def _axes(values: list[Row | None], digits: int = 1) -> str:
    return "/".join(number(value, digits) for value in values)


def _range(value: Row) -> str:
    return f"{value['median']:.2f}\n{value['p10']:.2f} to {value['p90']:.2f}"
