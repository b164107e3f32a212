"""The page: one HTML file with all in it."""

from collections.abc import Iterable
from string import Template

import numpy as np

from pretouch import __version__
from pretouch.reporting.course import Course
from pretouch.reporting.figures.force import close_up_figure, force_figure
from pretouch.reporting.figures.image import picture, style
from pretouch.reporting.figures.motion import joint_figure, motion_figure, path_figure
from pretouch.reporting.html import Html, Text, element, html, joined
from pretouch.reporting.limits import acceleration_fraction, speed_fraction
from pretouch.reporting.measures import Measures
from pretouch.reporting.orientation import BodyLimits
from pretouch.reporting.sections.contact import contact_section, orientation_section
from pretouch.reporting.sections.motion import distance_section, limit_section, mode_section, speed_section
from pretouch.reporting.sections.setting import health_section, parameter_section, setting_section
from pretouch.reporting.summary import compared, comparison, summary

_PAGE = Template(
    """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>$title</title>
<style>$style</style>
</head>
<body>
<main>
$body
<footer>Written by Pretouch $version. Nothing here claims conformity with a safety standard.</footer>
</main>
</body>
</html>
"""
)

_STYLE = """
:root { --ink: #1f2933; --soft: #616e7c; --line: #dde3e9; --ground: #fff; --other: #fdf3d8; --bad: #c53030;
  --bar: #7b93ab; }
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e4e7eb; --soft: #9aa5b1; --line: #3a4653; --ground: #171c22; --other: #4a3d16; --bad: #fc8181;
    --bar: #829ab1; }
  figure img { filter: invert(.9) hue-rotate(180deg); }
}
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--ground); margin: 0; }
main { max-width: 68rem; margin: 2rem auto; padding: 0 1.2rem; }
h1 { font-size: 1.7rem; line-height: 1.2; } h2 { font-size: 1.35rem; overflow-wrap: anywhere; }
h1, h2 { margin: 0 0 .6rem; } h3 { font-size: 1.08rem; margin: 2rem 0 .5rem; } h4 { margin: 1rem 0 .3rem; }
section { border-top: 2px solid var(--ink); margin-top: 2.5rem; padding-top: 1rem; }
.summary { font-size: 1.05rem; max-width: 52rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .82rem; margin: .5rem 0; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--line); padding: .22rem .55rem; text-align: right; vertical-align: top; }
td { white-space: nowrap; } td.w { white-space: normal; }
th { font-weight: 600; } thead th { vertical-align: bottom; color: var(--soft); border-bottom-color: var(--soft); }
.w { text-align: left; } .facts th { color: var(--soft); font-weight: 400; white-space: nowrap; }
.facts td { overflow-wrap: anywhere; }
.columns { display: flex; flex-wrap: wrap; gap: 0 3rem; }
.vector { white-space: pre; } .note, figcaption, footer { color: var(--soft); font-size: .82rem; max-width: 52rem; }
.bad { color: var(--bad); font-weight: 600; } .other { background: var(--other); padding: 0 .3rem; }
.bar { width: 9rem; height: .55rem; margin-top: .35rem; background: var(--line); }
.bar div { height: 100%; background: var(--bar); } .over div { background: var(--bad); }
figure { margin: 1rem 0; } figure img { max-width: 100%; height: auto; background: #fff; }
a { color: inherit; } footer { border-top: 1px solid var(--line); margin-top: 2.5rem; padding-top: .5rem; }
@media print {
  body { font-size: 10pt; } main { max-width: none; margin: 0; } section { break-before: page; }
  section:first-of-type { break-before: auto; } figure, tr { break-inside: avoid; } h3 { break-after: avoid; }
  .bar div { print-color-adjust: exact; } .scroll { overflow: visible; }
}
"""


def page(recordings: Iterable[Measures], limits: BodyLimits) -> str:
    """Make the page of one recording or several; of each no more than its text is kept."""
    title, rows, sections = "", [], []
    for order, m in enumerate(recordings, 1):
        rows.append(compared(order, m))
        sections.append(_recording(order, m, limits))
        title = m.title
    head = [element("h1", "Pretouch report")]
    if len(rows) > 1:
        title = f"{len(rows)} recordings"
        head.append(comparison(rows))
    body = joined([*head, *sections])
    return _PAGE.substitute(title=html(f"Pretouch report: {title}"), style=_STYLE, body=body, version=__version__)


def _recording(order: int, m: Measures, limits: BodyLimits) -> Html:
    parts: list[Text] = [element("h2", m.title), summary(m), element("h3", "What ran"), setting_section(m)]
    if len(m.course):
        with style():
            parts += _body(m, limits)
    return element("section", joined(parts), anchor=f"recording-{order}")


def _body(m: Measures, limits: BodyLimits) -> list[Text]:
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
        orientation_section(m, limits),
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
