"""The site's navigation, in the order of the documents' index."""

import re

_SECTION = re.compile(r"^## (.*)$|^- \[(.*?)\]\((.*?)\)", re.MULTILINE)
Entry = dict[str, "str | list[Entry]"]


def navigation(index: str, generated: dict[str, str]) -> list[Entry]:
    """Return the navigation of an index: its sections with their lists.

    Args:
        index: text of the index; a list of links below a heading is a section.
        generated: pages that the index cannot know, title by page, which end its reference.
    """
    sections: dict[str, list[Entry]] = {}
    for heading, title, page in _SECTION.findall(index):
        if heading:
            current = sections.setdefault(heading, [])
        else:
            current.append({title: page})
    sections["Reference"] += [{title: page} for page, title in generated.items()]
    listed: list[Entry] = [{title: entries} for title, entries in sections.items() if entries]
    return [{"Home": "index.md"}, *listed]
