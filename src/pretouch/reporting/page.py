"""The pages, one HTML file each with all in it: a report of recordings, and what `pretouch detect` found in one."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.figure import Figure

from pretouch.reporting.contacts import contact_section
from pretouch.reporting.figures import (
    close_up_figure,
    force_figure,
    joint_figure,
    motion_figure,
    path_figure,
    picture,
    style,
)
from pretouch.reporting.health import health_section
from pretouch.reporting.html import Html, Text, document, element, joined, table_html
from pretouch.reporting.limits import limit_section, mode_section
from pretouch.reporting.measures import Measures, compared, comparison, summary
from pretouch.reporting.motion import distance_section, speed_section
from pretouch.reporting.orientation import orientation_section
from pretouch.reporting.setting import parameter_section, setting_section
from pretouch.text_table import TextTable

_SHADED = "Red: REACT, grey: HOLD."


def page(recordings: Iterable[Measures]) -> str:
    """Make the page of one recording or several; of each no more than its text is kept."""
    title, rows, sections = "", [], []
    for order, m in enumerate(recordings, 1):
        rows.append(compared(order, m))
        with style():
            sections.append(element("section", joined(_recording(m)), anchor=f"recording-{order}"))
        title = m.title
    head = [element("h1", "Pretouch report")]
    if len(rows) > 1:
        title = f"{len(rows)} recordings"
        head.append(comparison(rows))
    return document(f"Pretouch report: {title}", joined([*head, *sections]))


def _recording(m: Measures) -> list[Text]:
    """All about one recording."""
    course = m.course
    forces = (
        "Force on the arm and contact thresholds by axis, base frame; evidence, a contact from 1 on."
        if course.by_thresholds
        else "Force on the arm by axis, base frame, with the bands in which one sample of it alone would be no contact."
        " What decides is the evidence, made of all joint torques and many samples: a contact from 1 on."
    )
    seen = "Sensed distances from the body, s" if course.proximity_used else "S"
    fractions = "Distance from position limits, and commands as fractions of the limits."
    return [
        element("h2", m.title),
        summary(m),
        element("h3", "What ran"),
        setting_section(course, m.lacking),
        element("h3", "Contacts"),
        contact_section(course, m.contacts),
        picture(force_figure(course), f"{forces} {_SHADED}"),
        *_strongest(m),
        element("h3", "Distances"),
        distance_section(course, m.distances),
        element("h3", "Speed"),
        speed_section(m.speeds),
        picture(motion_figure(course), f"{seen}peed of the end-effector, and speed factor. {_SHADED}"),
        picture(path_figure(course), "Path and end-effector seen from the front of the arm (from +x)."),
        element("h3", "Modes and quadratic program"),
        mode_section(m.states),
        element("h3", "Limits of the arm"),
        limit_section(m.joints),
        picture(joint_figure(course), f"{fractions} {_SHADED}"),
        element("h3", "Units, robot and loop"),
        health_section(m.units, m.loop),
        element("h3", "Forces beside limits of body regions: for orientation, not conformity"),
        orientation_section(m.contacts),
        element("h3", "Parameters"),
        parameter_section(course),
    ]


def _strongest(m: Measures) -> list[Html]:
    """Show the contact with the largest estimate close up."""
    sizes = np.array([d.peak_norm for d in m.contacts.detections])
    if not np.isfinite(sizes).any():
        return []
    order = int(np.nanargmax(sizes))
    strongest = m.contacts.detections[order]
    figure = close_up_figure(m.course, strongest.time, strongest.force)
    return [picture(figure, f"Contact {order + 1}, the one with the largest force estimate, close up.")]


def detection_page(
    title: str, sentences: Sequence[str], tables: Sequence[TextTable], figures: Sequence[tuple[Figure, str]]
) -> str:
    """Make the page of what detectors found: sentences, tables, and figures with what they show."""
    with style():
        drawn = [picture(figure, text) for figure, text in figures]
    head = [element("h1", f"Contacts in {title}"), *(element("p", sentence, "summary") for sentence in sentences[:1])]
    notes = [element("ul", joined(element("li", text) for text in sentences[1:]))] if sentences[1:] else []
    return document(f"Contacts in {title}", joined([*head, *notes, *map(table_html, tables), *drawn]))
