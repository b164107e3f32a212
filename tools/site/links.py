"""Replaces links to files of the repository by links to pages of the site."""

import os
import re
from pathlib import Path

_LINK = re.compile(r"(\]\()(?!https?:)([^)#\s]+)(#[^)\s]*)?(\))")
_CODE = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)


class Layout:
    """Place of each file of the repository on the site: documents as they are, other files as pages of source."""

    def __init__(self, root: Path, pages: Path, beside: dict[str, str]) -> None:
        self.root, self.pages = root, pages
        self._beside = beside
        self.sources: dict[Path, Path] = {}
        """Linked files and folders that are no documents, with the page of each."""

    def page_of(self, file: Path) -> Path:
        """Return the page of a file or folder of the repository, a new page if it is no document."""
        name = str(file.relative_to(self.root))
        if name in self._beside:
            return self.pages / self._beside[name]
        if file.is_relative_to(self.root / "docs"):
            page = self.pages / file.relative_to(self.root / "docs")
            return page.with_suffix(".md") if file.suffix == ".ipynb" else page
        return self.sources.setdefault(file, self.pages / "source" / f"{name}.md")

    def documents(self) -> list[Path]:
        """Return the repository's documents."""
        return [*sorted((self.root / "docs").rglob("*.md")), *(self.root / name for name in self._beside)]

    def rebased(self, document: Path) -> str:
        """Return a document's text with the links of the site."""
        page = self.page_of(document)

        def moved(link: re.Match[str]) -> str:
            target = self.page_of((document.parent / link[2]).resolve())
            return f"{link[1]}{os.path.relpath(target, page.parent)}{link[3] or ''}{link[4]}"

        parts = _CODE.split(document.read_text(encoding="utf-8"))
        return "".join(part if part.startswith("```") else _LINK.sub(moved, part) for part in parts)


def source_page(file: Path, root: Path) -> str:
    """Return a page with the text of a file, or of the files in a folder."""
    files = [file] if file.is_file() else sorted(path for path in file.iterdir() if path.is_file())
    kinds = {".py": "python", ".toml": "toml"}
    sections = [
        f"## {path.name}\n\n````{kinds.get(path.suffix, 'text')}\n{path.read_text(encoding='utf-8').rstrip()}\n````\n"
        for path in files
    ]
    # a search finds what is said of a file, not the file
    return "\n".join([f"---\nsearch: {{exclude: true}}\n---\n# {file.relative_to(root)}\n", *sections])
