"""What the site needs beyond docs/: pages from elsewhere in the repository, and links and lists as its renderer wants.

The pages are written to be read as they lie in the repository.  Four things differ on the site: README.md is its
first page, files above docs/ have names of their own, a list needs a blank line before it, and the public names of the
packages have a page that is made of their docstrings.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
# File of the repository -> page of the site.
ELSEWHERE = {"README.md": "index.md", "benchmarks/README.md": "benchmarks.md", "CHANGELOG.md": "changelog.md",
             "CONTRIBUTING.md": "contributing.md"}
# Page of the site -> the package whose public names it tells.
NAMES = {"names_coupler.md": "coupler", "names_half.md": "contact.half"}

_FENCE = re.compile(r"^\s*(```|~~~)")
_ITEM = re.compile(r"^\s*([-*+]|\d+\.) ")
_LINK = re.compile(r"(?<=\]\()(?![a-z]+:|#)([^)#\s]+)(#[^)\s]*)?(?=\))")
_CODE = re.compile(r"`[^`]*`")


def on_files(files: Files, config: Any, **_: Any) -> Files:
    """Add the pages from elsewhere and those of names, the scenarios, style sheet and script."""
    for source, page in ELSEWHERE.items():
        files.append(File.generated(config, page, content=(ROOT / source).read_text(encoding="utf-8")))
    for page, package in NAMES.items():
        files.append(File.generated(config, page, content=f"# {package}\n\n::: {package}\n"))
    for path in sorted((ROOT / "scenarios").glob("*.yaml")):
        files.append(File.generated(config, f"scenarios/{path.name}", content=path.read_text(encoding="utf-8")))
    for name in ("site.css", "search.js"):
        text = Path(__file__).with_name(name).read_text(encoding="utf-8")
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """One page as the site's renderer wants it; code stays as it is."""
    names = {page: source for source, page in ELSEWHERE.items()}
    source = names.get(page.file.src_uri, f"docs/{page.file.src_uri}")
    return "\n".join(_lines(markdown, posixpath.dirname(source), posixpath.dirname(page.file.src_uri)))


def on_post_page(output: str, **_: Any) -> str:
    """Our own script in the place of the one that the theme would fetch."""
    return output.replace("https://unpkg.com/iframe-worker/shim", "search.js")


def on_post_template(output_content: str, **_: Any) -> str:
    """The same for pages that no text of ours stands behind, such as 404.html."""
    return on_post_page(output_content)


def site_link(target: str, folder: str) -> str:
    """Where a relative link of a page in `folder` of the repository leads on the site."""
    there = posixpath.normpath(posixpath.join(folder, target))
    return ELSEWHERE.get(there, there.removeprefix("docs/"))


def _lines(markdown: str, folder: str, page_folder: str) -> Iterator[str]:
    code, before = False, ""
    for line in markdown.splitlines():
        if _FENCE.match(line):
            code = not code
        elif not code:
            if _ITEM.match(line) and before.strip() and not _ITEM.match(before) and not before.startswith((" ", "\t")):
                yield ""
            line = _LINK.sub(lambda m: posixpath.relpath(site_link(m[1], folder), page_folder or ".") + (m[2] or ""),
                             line)
            if line.startswith("|"):
                # Code in a cell of a table: the renderer takes no escape there, and needs none.
                line = _CODE.sub(lambda m: m[0].replace("\\|", "|"), line)
        yield line
        before = line
