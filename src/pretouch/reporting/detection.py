"""The page of `pretouch detect`: what detectors made of a recording, one HTML file with all in it."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from pretouch.reporting.figures.marks import picture, style
from pretouch.reporting.html import Html, Text, document, element, joined, titled_table
from pretouch.text_table import TextTable


def detection_page(
    title: str, said: Sequence[str], tables: Sequence[TextTable], figures: Sequence[tuple[Figure, str]]
) -> str:
    """Make the page: sentences, tables, and figures with what they show."""
    with style():
        drawn: list[Text] = [picture(figure, text) for figure, text in figures]
    head = [element("h1", f"Contacts in {title}"), *(element("p", sentence, "summary") for sentence in said[:1])]
    notes = element("ul", joined(element("li", sentence) for sentence in said[1:])) if said[1:] else Html("")
    body = joined([*head, notes, *(titled_table(table) for table in tables), *drawn])
    note = "Nothing here claims conformity with a safety standard."
    return document(f"Contacts in {title}", body, note)
