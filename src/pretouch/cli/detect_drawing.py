"""What `pretouch detect` draws: a figure, or a page with figures and tables."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.atomic_write import atomic_write
from pretouch.cli.writing import unwritable_said
from pretouch.text_table import TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENDINGS = (".png", ".pdf", ".svg", ".html")
_DOTS_PER_INCH = 150


def write_drawing(
    title: str, said: Sequence[str], tables: Sequence[TextTable], figures: Sequence[tuple["Figure", str]], out: Path
) -> None:
    """Write the first of some figures, or with the ending .html a page of all with sentences and tables."""
    if out.suffix == ".html":
        from pretouch.reporting.detection import detection_page

        page = detection_page(title, said, tables, figures)
        with unwritable_said("page", out):
            atomic_write(out, page)
        return
    image = BytesIO()
    figures[0][0].savefig(image, format=out.suffix[1:], dpi=_DOTS_PER_INCH)
    with unwritable_said("figure", out):
        out.write_bytes(image.getvalue())
