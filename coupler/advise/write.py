"""The advised scenario as a file: that of the user, comments kept, with what can go taken out."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

from coupler.advise.coarse import meshed, timed
from coupler.advise.edit import Edit, at, edited
from coupler.advise.known import Known, edits_of
from coupler.advise.ladder import iterated
from coupler.errors import ResultsError
from coupler.record.beside import part_of
from coupler.scenario.document import Document
from coupler.scenario.reading import document_from
from coupler.scenario.writing import WIDTH, dumped, layout

# Merged keys and anchors: an edit in one place would be one in several.
_SHARED = re.compile(r"<<\s*:|(?:^|[\s\[{,:])[&*][A-Za-z_]", re.MULTILINE)


def advised(document: Document, known: Known) -> list[Edit]:
    """The edits that make a scenario of what was found."""
    edits = edits_of(known.taken, iterated(document.tree) if known.iterate else None)
    mesh, windows = known.factors
    tree = edited(document.tree, edits)
    # fault: advice: an advised mesh in the windows of the file -> return [*edits, meshed(tree, mesh), timed(tree, 1.0)]
    #   | coupler/test_advise
    return [*edits, meshed(tree, mesh), timed(tree, windows)]


def text_of(document: Document, edits: Sequence[Edit], head: Sequence[str], path: Path) -> str:
    """The scenario file with edits, to stand at `path`; head : lines of a comment at its top.

    Comments stay where the file can be edited in place; with merged or shared parts it is written anew without them.
    """
    edits = [*edits, _moved(document, path.parent)]
    wanted = edited(document.tree, edits)
    yaml = layout()
    top = "".join(f"{part}\n" for line in head for part in wrap(
        line, WIDTH, initial_indent="# ", subsequent_indent="#     ", replace_whitespace=False))
    if not _SHARED.search(document.text):
        tree = yaml.load(document.text)
        _override(tree, document)
        text = top + "#\n" + dumped(edited(tree, edits), yaml)
        if document_from(path, text).tree == wanted:
            return text
    yaml.default_flow_style = None
    text = top + dumped(wanted, yaml)
    assert document_from(path, text).tree == wanted, "plain values survive being written"
    return text


def _override(tree: Any, document: Document) -> None:
    """Bring what overrides put into the plain values into the commented ones."""
    for key in sorted(document.overridden, key=len):
        # Where an override made a mapping on its way, the whole of that is put.
        n = next((n for n in range(1, len(key)) if at(tree, key[:n]) is None), len(key))
        holder, plain = at(tree, key[:n - 1]), at(document.tree, key[:n - 1])
        holder[key[n - 1]] = plain[key[n - 1]]
        for gone in [k for k in holder if isinstance(holder, dict) and k not in plain]:
            del holder[gone]


def write(path: Path, text: str) -> Path:
    """Whole or not at all.  Raises ResultsError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part_of(path).write_text(text, encoding="utf-8")
        os.replace(part_of(path), path)
    except OSError as exc:
        raise ResultsError(f"{path}: cannot be written ({exc.strerror})") from exc
    return path


def _moved(document: Document, folder: Path) -> Edit:
    """Mesh files are looked for beside a scenario: elsewhere they need their whole path."""
    if folder.resolve() == document.path.parent.resolve():
        return Edit()
    files = {("bodies", name, "mesh", "file", "path"): body["mesh"]["file"]["path"]
             for name, body in document.tree["bodies"].items() if at(body, ("mesh", "file", "path")) is not None}
    return Edit({key: str((document.path.parent / path).resolve()) for key, path in files.items()})

