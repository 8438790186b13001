"""The templates: files of coupler/templates, each a whole scenario with a comment at its head."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from coupler.errors import ScenarioError
from coupler.scenario.document import Document
from coupler.scenario.quantity import did_you_mean
from coupler.scenario.reading import document_from, read_document

FOLDER = Path(__file__).resolve().parent.parent / "templates"


@dataclass(frozen=True)
class Template:
    """A scenario to begin with.  path : its file.  name : by which it is asked for, the file's without its ending."""

    path: Path

    @property
    def name(self) -> str:
        return self.path.stem

    @cached_property
    def document(self) -> Document:
        """Its content.  Raises ScenarioError where the installation is damaged."""
        return read_document(self.path)

    @property
    def about(self) -> str:
        """What it is: the first line of its head."""
        return self.document.text.partition("\n")[0].lstrip("# ")

    def text_for(self, file: str) -> str:
        """Its text with the new file's name in the commands of its head."""
        return self.document.text.replace(self.path.name, file)

    def document_for(self, path: Path) -> Document:
        """What stands in a copy of it at `path`."""
        return document_from(path, self.text_for(path.name))


def templates(folder: Path = FOLDER) -> Mapping[str, Template]:
    """All templates by name.  Raises ScenarioError where the installation has none."""
    found = {path.stem: Template(path) for path in sorted(folder.glob("*.yaml"))}
    if not found:
        raise ScenarioError("the templates that belong to this installation are missing", file=str(folder),
                            remedy="Install slideline again")
    return found


def template_named(name: str) -> Template:
    """The template of a name.  Raises ScenarioError with the nearest one."""
    known = templates()
    if name not in known:
        raise ScenarioError("there is no such template", key="TEMPLATE", value=name,
                            remedy=did_you_mean(name, known))
    return known[name]
