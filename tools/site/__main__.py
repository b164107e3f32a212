"""Builds the documentation site as build/site: `make docs`."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import tomli_w
from tools.notebook import page_of
from tools.site.generated import PAGES, generated_pages
from tools.site.links import Layout, source_page
from tools.site.navigation import navigation

ROOT = Path(__file__).parents[2]
_BESIDE = {
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "CHANGELOG.md": "changelog.md",
    "fci/README.md": "pretouch-fci.md",
}
"""Documents outside `docs`, and their pages."""


def write_pages(pages: Path) -> None:
    """Write all pages and their images below a new folder."""
    shutil.rmtree(pages, ignore_errors=True)
    shutil.copytree(ROOT / "docs", pages)
    (pages / "assets").mkdir()
    shutil.copy(Path(__file__).with_name("iframe-worker.js"), pages / "assets")
    layout = Layout(ROOT, pages, _BESIDE)
    texts = {layout.page_of(document): layout.rebased(document) for document in layout.documents()}
    texts |= {page: source_page(file, ROOT) for file, page in layout.sources.items()}
    for notebook in sorted((ROOT / "docs").rglob("*.ipynb")):
        texts[layout.page_of(notebook)] = page_of(notebook, layout.page_of(notebook))
    texts |= {pages / page: text for page, text in generated_pages().items()}
    for page, text in texts.items():
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(text, encoding="utf-8")


def build(out: Path) -> int:
    """Build the site below a folder; return the generator's exit code."""
    settings = tomllib.loads(Path(__file__).with_name("zensical.toml").read_text(encoding="utf-8"))
    pages, config = out / "site-pages", out / "zensical.toml"
    write_pages(pages)
    nav = navigation((pages / "index.md").read_text(encoding="utf-8"), PAGES)
    settings["project"] |= {"docs_dir": pages.name, "site_dir": "site", "nav": nav}
    settings["project"]["plugins"]["mkdocstrings"]["handlers"]["python"]["paths"] = [str(ROOT / "src")]
    config.write_text(tomli_w.dumps(settings), encoding="utf-8")
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict", "--config-file", config.name]
    code = subprocess.run(command, cwd=out, check=False).returncode
    print(f"The site is {out / 'site' / 'index.html'}." if code == 0 else "The site was not built.")
    return code


if __name__ == "__main__":
    sys.exit(build(ROOT / "build"))
