"""Runs a notebook, stores the outputs of its cells, and writes it as a page.

    python -m tools.notebook docs/tutorial/first-contact.ipynb

The cells run in this process, one after the other, in a folder that is removed.
"""

import base64
import io
import json
import sys
from contextlib import chdir, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib as mpl
from matplotlib import pyplot as plt

Cell = dict[str, Any]
"""A cell in the format of the file (nbformat 4)."""


def cells_of(notebook: Path) -> list[Cell]:
    """Return the cells of a notebook."""
    return list(json.loads(notebook.read_text(encoding="utf-8"))["cells"])


def outputs_of(cells: list[Cell]) -> list[list[Cell]]:
    """Run the code cells in one namespace; return the outputs of each."""
    mpl.use("agg")
    outputs, names = [], {"__name__": "__main__"}
    with TemporaryDirectory() as folder, chdir(folder):
        for number, cell in enumerate(cell for cell in cells if cell["cell_type"] == "code"):
            printed = io.StringIO()
            with redirect_stdout(printed):
                exec(compile("".join(cell["source"]), f"cell {number + 1}", "exec"), names)  # noqa: S102  # our own text
            lines = printed.getvalue().splitlines(keepends=True)
            text = [{"output_type": "stream", "name": "stdout", "text": lines}] if lines else []
            outputs.append([*text, *(_drawn(plt.figure(figure)) for figure in plt.get_fignums())])
            plt.close("all")
    return outputs


def _drawn(figure: Any) -> Cell:
    """Return a figure as an output; its title is the text for readers without images."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=80, metadata={"Software": None})
    data = {"image/png": base64.b64encode(drawn.getvalue()).decode(), "text/plain": [figure.get_suptitle()]}
    return {"output_type": "display_data", "metadata": {}, "data": data}


def page_of(notebook: Path, page: Path) -> str:
    """Return a notebook as the Markdown text of a page, and write its figures beside the page."""
    parts: list[str] = []
    for cell in cells_of(notebook):
        source = "".join(cell["source"])
        parts.append(f"```python\n{source}\n```" if cell["cell_type"] == "code" else source)
        for output in cell.get("outputs", []):
            if output["output_type"] == "stream":
                parts.append(f"```text\n{''.join(output['text'])}```")
            else:
                figure = page.with_name(f"{page.stem}-{len(parts)}.png")
                figure.write_bytes(base64.b64decode(output["data"]["image/png"]))
                parts.append(f"![{''.join(output['data']['text/plain'])}]({figure.name})")
    return "\n\n".join(parts) + "\n"


def main(notebook: Path) -> None:
    """Run a notebook and store the outputs in it."""
    cells = cells_of(notebook)
    outputs = iter(outputs_of(cells))
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
        if cell["cell_type"] == "code":
            cell |= {"execution_count": None, "outputs": next(outputs)}
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    about = {"kernelspec": kernel, "language_info": {"name": "python"}}
    book = {"cells": cells, "metadata": about, "nbformat": 4, "nbformat_minor": 5}
    notebook.write_text(json.dumps(book, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
