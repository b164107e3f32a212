"""The page: one HTML file with all in it."""

from collections.abc import Iterable

import numpy as np

from pretouch.reporting.course import Course
from pretouch.reporting.figures.force import close_up_figure, force_figure
from pretouch.reporting.figures.marks import picture, style
from pretouch.reporting.figures.motion import joint_figure, motion_figure, path_figure
from pretouch.reporting.html import Html, Text, document, element, joined
from pretouch.reporting.limits import acceleration_fraction, speed_fraction
from pretouch.reporting.measures import Measures
from pretouch.reporting.sections.contact import contact_section, orientation_section
from pretouch.reporting.sections.motion import distance_section, limit_section, mode_section, speed_section
from pretouch.reporting.sections.setting import health_section, parameter_section, setting_section
from pretouch.reporting.summary import compared, comparison, summary


def page(recordings: Iterable[Measures]) -> str:
    """Make the page of one recording or several; of each no more than its text is kept."""
    title, rows, sections = "", [], []
    for order, m in enumerate(recordings, 1):
        rows.append(compared(order, m))
        sections.append(_recording(order, m))
        title = m.title
    head = [element("h1", "Pretouch report")]
    if len(rows) > 1:
        title = f"{len(rows)} recordings"
        head.append(comparison(rows))
    note = "Nothing here claims conformity with a safety standard."
    return document(f"Pretouch report: {title}", joined([*head, *sections]), note)


def _recording(order: int, m: Measures) -> Html:
    parts: list[Text] = [element("h2", m.title), summary(m), element("h3", "What ran"), setting_section(m)]
    if len(m.course):
        with style():
            parts += _body(m)
    return element("section", joined(parts), anchor=f"recording-{order}")


def _body(m: Measures) -> list[Text]:
    """All that takes at least one control step."""
    course = m.course
    joints = joint_figure(course, speed_fraction(course), acceleration_fraction(course))
    shaded = "Red: REACT, grey: HOLD."
    seen = "Sensed distances from the body, s" if course.proximity_used else "S"
    return [
        element("h3", "Contacts"),
        contact_section(m),
        picture(force_figure(course), _force_said(course) + f" {shaded}"),
        *_strongest(m),
        element("h3", "Distances"),
        distance_section(m),
        element("h3", "Speed"),
        speed_section(m),
        picture(motion_figure(course), f"{seen}peed of the end-effector, and speed factor. {shaded}"),
        picture(path_figure(course), "Path and end-effector seen from the front of the arm (from +x)."),
        element("h3", "Modes and quadratic program"),
        mode_section(m),
        element("h3", "Limits of the arm"),
        limit_section(m),
        picture(joints, f"Distance from position limits, and commands as fractions of the limits. {shaded}"),
        element("h3", "Units, robot and loop"),
        health_section(m),
        element("h3", "Forces beside limits of body regions: for orientation, not conformity"),
        orientation_section(m),
        element("h3", "Parameters"),
        parameter_section(m),
    ]


def _force_said(course: Course) -> str:
    if course.by_thresholds:
        return "Force on the arm and contact thresholds by axis, base frame; evidence, a contact from 1 on."
    return (
        "Force on the arm by axis, base frame, with the bands in which one sample of it alone would be no contact."
        " What decides is the evidence, made of all joint torques and many samples: a contact from 1 on."
    )


def _strongest(m: Measures) -> list[Text]:
    """Show the contact with the largest estimate close up."""
    known = [(d.peak_norm, -i) for i, d in enumerate(m.detections) if np.isfinite(d.peak_norm)]
    if not known:
        return []
    order = -max(known)[1]
    strongest = m.detections[order]
    figure = close_up_figure(m.course, strongest.time, strongest.force)
    return [picture(figure, f"Contact {order + 1}, the one with the largest force estimate, close up.")]
