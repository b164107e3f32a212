"""What came out of the paper's three experiments, in sentences: the page and the demo begin with them."""

from pretouch_lab.rows import Row
from pretouch_lab.tables import controller, number, shown_controllers


def static_conclusion(part: Row) -> str:
    """Say how fast and how hard the arm ran into the object."""
    stiffness, modes, shown = shown_controllers(part["cells"])
    cells = [
        cell
        for name in shown
        for cell in part["pooled_cells"]
        if (cell["profile"], cell["restrictions"], cell["stiffness_n_per_m"]) == (name, modes[name], stiffness)
    ]
    said = "; ".join(f"{cell['profile']}: {_impact(cell)}" for cell in cells)
    return f"The arm runs into a board of {stiffness / 1000:g} N/mm (medians; force: the true one, over 20 ms). {said}."


def _impact(cell: Row) -> str:
    if not cell["contact_fraction"]:
        return "no contact"
    forces = f"{number(cell['true_peak_20ms_n'], 0)} N at {number(cell['impact_speed_m_s'], 2)} m/s"
    return forces + _in_some(cell)


def avoidance_conclusion(part: Row) -> str:
    """Say what a hand beside the path and one in it meet."""
    said = []
    for place, words in (("beside", "3 cm beside the arm's way"), ("inside", "into the arm's way")):
        cells = [cell for cell in part["cells"] if cell["place"] == place]
        if cells:
            what = "; ".join(f"{_name(cell, part)}: {_visited(cell)}" for cell in cells)
            said.append(f"A person holds a hand {words}. {what}.")
    return " ".join(said)


def _visited(cell: Row) -> str:
    if cell["contact_fraction"]:
        return f"hits it with {number(cell['true_peak_n'], 0)} N{_in_some(cell)}"
    slowest = number(cell["least_speed_scale"], 0, 100)
    speed = "at full speed" if slowest == "100" else f"slows to {slowest} %"
    return f"{speed}, {number(cell['least_gap_m'], 0, 1000)} mm away"


def dynamic_conclusion(part: Row) -> str:
    """Say how the arm answered pushes."""
    said = "; ".join(
        f"{_name(cell, part)}: {cell['detected']} of {cell['pushes']} detected"
        + (f", after {number(cell['delay_s'], 0, 1000)} ms" if cell["detected"] else "")
        for cell in part["cells"]
    )
    return f"A person pushes the moving arm. {said}."


def _name(cell: Row, part: Row) -> str:
    return " ".join(controller(cell, part["cells"]).split())


def _in_some(cell: Row) -> str:
    """Say in how many of several trials there was a contact, if not in all."""
    touched = round(cell["contact_fraction"] * cell["trials"])
    return f", in {touched} of {cell['trials']} trials" if touched < cell["trials"] else ""
