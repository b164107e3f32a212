"""Pages generated from the code at build time: public names, commands and parameters."""

import io
import pkgutil
import re
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import MISSING, Field, fields, is_dataclass
from importlib import import_module
from unittest.mock import patch

import pretouch
from pretouch.checks import Checked
from pretouch.cli import main
from pretouch.cli.app import command_names
from pretouch.composition import field_docs

API = {
    "arm-and-skin": ("Arm and skin", ("arms", "groups", "robot", "sensing")),
    "controller": ("Controller and profiles", ("controller", "profiles", "composition", "params", "explanation")),
    "parts": ("Parts of a controller", ("contact", "control", "perception")),
    "loop": ("Loop and recordings", ("loop", "shielding", "realtime", "recording", "reporting")),
    "simulation": ("Simulation", ("sim",)),
    "values": ("Values and errors", ("types", "desired", "limited", "errors")),
}
"""Pages of public names: title, and modules of the names."""
PAGES = {
    **{f"reference/python-{page}.md": f"Python: {title}" for page, (title, _) in API.items()},
    "reference/commands.md": "Commands",
    "reference/parameters.md": "Parameters",
}
"""Title of each generated page."""


def public_names(packages: tuple[str, ...]) -> list[str]:
    """Return the public names of some modules of the product and of modules below them, by the place of definition."""
    places = (f"{place}.{name}" for name, place in pretouch._PLACE.items())
    return sorted(place for place in places if place.split(".")[1] in packages)


def api_page(title: str, packages: tuple[str, ...]) -> str:
    """Return the page of some public names, from their docstrings."""
    top = f"# {title}\n\nFor readers who write programs: the names of `import pretouch as pt`, with units and shapes.\n"
    return "\n".join([top, *(f"::: {name}\n" for name in public_names(packages))])


def _help(words: list[str]) -> str:
    """Return the output of a command's help, 80 columns wide."""
    text = io.StringIO()
    with patch.dict("os.environ", {"COLUMNS": "80", "NO_COLOR": "1"}), redirect_stdout(text):
        try:
            main([*words, "--help-all" if words == ["run"] else "--help"])
        except SystemExit as ended:
            if ended.code:
                raise
    return text.getvalue().rstrip()


def _commands(words: list[str]) -> Iterator[tuple[str, str]]:
    """Yield a command and those below it, each with its help."""
    text = _help(words)
    yield " ".join(words), text
    below = re.search(r"\{([\w,-]+)\}$", text.split("\n\n")[0])  # alone behind a usage: what follows the command
    for name in below[1].split(",") if below else ():
        yield from _commands([*words, name])


def commands_page() -> str:
    """Return the page of all commands, from their own help."""
    helps = [each for name in command_names() for each in _commands([name])]
    sections = [f"## pretouch {words}\n\n```text\n{text}\n```\n" for words, text in helps]
    return "\n".join(["# Commands\n\nFor readers who look up an option: the help of each command.\n", *sections])


def parameter_sets() -> list[type]:
    """Return all classes of parameters of the product, except base classes of others."""
    for module in pkgutil.walk_packages(pretouch.__path__, "pretouch."):
        if module.name.endswith("__main__"):
            continue
        try:
            import_module(module.name)
        except ModuleNotFoundError as error:  # of a vendor's library: no parameters are in a module that needs one
            if str(error.name).startswith("pretouch"):
                raise
    kinds = [kind for kind in _below(Checked) if is_dataclass(kind) and not kind.__name__.startswith("_")]
    own = [kind for kind in kinds if kind.__module__.startswith("pretouch.")]
    return sorted({k for k in own if not any(is_dataclass(o) and o in own for o in k.__subclasses__())}, key=str)


def _below(kind: type) -> Iterator[type]:
    for each in kind.__subclasses__():
        yield each
        yield from _below(each)


def _default(field: Field[object]) -> str:
    value = field.default if field.default_factory is MISSING else field.default_factory()
    if value is MISSING:
        return "required"
    if is_dataclass(value):
        return type(value).__name__
    if isinstance(value, tuple):
        return ", ".join(f"{item:g}" if isinstance(item, float) else str(item) for item in value) or "none"
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def parameters_page() -> str:
    """Return the page of all parameters: default, unit, meaning and source of each."""
    text = ["# Parameters\n\nFor readers who tune: all parameters, from the code. A value without a source is ours.\n"]
    for kind in parameter_sets():
        about = (kind.__doc__ or "").split("\n\n")[0]
        text.append(f"## {kind.__name__}\n\n{' '.join(about.split())} `{kind.__module__}`\n")
        text.append("| parameter | default | unit | meaning and source |\n| --- | --- | --- | --- |")
        docs = field_docs(kind)
        for field in fields(kind):
            doc = docs.get(field.name, "")
            unit = re.search(r" \[([^\]]*)\]", doc)
            meaning = doc.replace(unit[0], "", 1) if unit else doc
            row = (f"`{field.name}`", _default(field), unit[1] if unit else "", meaning)
            text.append("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
        text.append("")
    return "\n".join(text)


def generated_pages() -> dict[str, str]:
    """Return the text of each generated page."""
    pages = {f"reference/python-{page}.md": api_page(*arguments) for page, arguments in API.items()}
    return pages | {"reference/commands.md": commands_page(), "reference/parameters.md": parameters_page()}
