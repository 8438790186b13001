"""Sorts the blocks of a deck: meshes by part and instance, materials, interactions, steps, and the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from coupler.deck.lexer import DeckLine, KeywordBlock, number, wrong

MATERIAL = ("ELASTIC", "EXPANSION", "CONDUCTIVITY", "SPECIFIC HEAT", "DENSITY", "PLASTIC", "LATENT HEAT",
            "INELASTIC HEAT FRACTION")
INTERACTION = ("SURFACE BEHAVIOR", "GAP CONDUCTANCE", "GAP RADIATION", "GAP HEAT GENERATION", "FRICTION")
SCOPED = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "SOLID SECTION")
MAX_STEPS = 1000


@dataclass(frozen=True)
class Scoped:
    """A block and the part it belongs to, empty outside of parts."""

    block: KeywordBlock
    part: str


@dataclass(frozen=True)
class Owner:
    """A *MATERIAL, *SURFACE INTERACTION or *STEP, and the blocks that are its own."""

    block: KeywordBlock
    own: list[KeywordBlock] = field(default_factory=list)


@dataclass(frozen=True)
class Outline:
    """The blocks of a deck by what they belong to.

    mesh : blocks of meshes.  parts : instance -> part, in capitals.  spelled : part -> instance as written.
    shifts : part -> translation.  materials, interactions : name -> owner.  model : all other blocks.
    """

    title: str
    mesh: Sequence[Scoped]
    parts: Mapping[str, str]
    spelled: Mapping[str, str]
    shifts: Mapping[str, tuple[float, float]]
    materials: Mapping[str, Owner]
    interactions: Mapping[str, Owner]
    steps: Sequence[Owner]
    model: Sequence[KeywordBlock]


@dataclass
class _Sorting:
    """The state of the walk through the blocks."""

    part: str = ""
    material: Owner | None = None
    interaction: Owner | None = None
    step: Owner | None = None
    title: str = ""
    mesh: list[Scoped] = field(default_factory=list)
    parts: dict[str, str] = field(default_factory=dict)
    spelled: dict[str, str] = field(default_factory=dict)
    shifts: dict[str, tuple[float, float]] = field(default_factory=dict)
    materials: dict[str, Owner] = field(default_factory=dict)
    interactions: dict[str, Owner] = field(default_factory=dict)
    steps: list[Owner] = field(default_factory=list)
    model: list[KeywordBlock] = field(default_factory=list)

    def take(self, block: KeywordBlock) -> None:
        """Put one block where it belongs."""
        word = block.word
        if word in ("PART", "INSTANCE", "END PART", "END INSTANCE"):
            self._scope(block)
        elif word in ("MATERIAL", "SURFACE INTERACTION"):
            self._owner(block)
        elif word in MATERIAL + INTERACTION:
            owner = self.material if word in MATERIAL else self.interaction
            if owner is None:
                need = "*MATERIAL" if word in MATERIAL else "*SURFACE INTERACTION"
                raise wrong(block.row, f"*{word} belongs to a {need}, and there is none before it")
            owner.own.append(block)
        elif word == "STEP":
            self.step = Owner(block)
            self.steps.append(self.step)
            if len(self.steps) > MAX_STEPS:
                raise wrong(block.row, f"more than {MAX_STEPS} steps")
        elif word == "END STEP":
            self.step = None
        elif word in SCOPED:
            self.mesh.append(Scoped(block, self.part))
        elif word == "HEADING":
            self.title = self.title or (block.data[0].excerpt if block.data else "")
        elif word not in ("ASSEMBLY", "END ASSEMBLY"):
            (self.step.own if self.step else self.model).append(block)

    def _owner(self, block: KeywordBlock) -> None:
        owners = self.materials if block.word == "MATERIAL" else self.interactions
        name = named(block, "NAME")
        if name in owners:
            raise wrong(block.row, f"*{block.word} {name} is there twice", "Give each a name of its own.")
        owners[name] = Owner(block)
        if block.word == "MATERIAL":
            self.material = owners[name]
        else:
            self.interaction = owners[name]

    def _scope(self, block: KeywordBlock) -> None:
        if block.word.startswith("END"):
            self.part = ""
        elif block.word == "PART":
            self.part = named(block, "NAME")
        else:
            self.part = self._instance(block)

    def _instance(self, block: KeywordBlock) -> str:
        part, name = named(block, "PART"), named(block, "NAME")
        if part in self.parts.values():
            raise wrong(block.row, f"part {part} has two instances", "Write the deck flat, or copy the part.")
        if len(block.data) > 1:
            raise wrong(block.data[1], "an instance may be moved, but not turned", "Turn the part's own mesh.")
        self.parts[name], self.spelled[part] = part, block.options["NAME"]
        if block.data:
            x, y, z = (number(block.data[0], i, "a translation", 0.0) for i in range(3))
            if z:
                raise wrong(block.data[0], "an instance leaves the plane", "All bodies lie in the x-y plane.")
            self.shifts[part] = (x, y)
        return part


def named(block: KeywordBlock, option: str) -> str:
    """Return the name a keyword line must give, in capitals.  Raises ScenarioError where it gives none."""
    name = block.option(option)
    if not name or len(name) > 200:
        raise wrong(block.row, f"*{block.word} needs {option}=...")
    return name


def outline_of(blocks: Sequence[KeywordBlock]) -> Outline:
    """Sort the blocks of a deck.  Raises ScenarioError for a block in a place where it has no meaning."""
    s = _Sorting()
    for block in blocks:
        s.take(block)
    for scoped in s.mesh:
        if scoped.part and scoped.part not in s.parts.values():
            raise wrong(scoped.block.row, f"part {scoped.part} has no instance",
                        "Add *INSTANCE to the assembly, or take the part out.")
    return Outline(s.title, s.mesh, s.parts, s.spelled, s.shifts, s.materials, s.interactions, s.steps, s.model)


def scope_of(reference: str, part: str, parts: Mapping[str, str], row: DeckLine) -> tuple[str, str]:
    """Return (part, name in capitals) of a reference, NAME or INSTANCE.NAME.  Raises ScenarioError."""
    name = reference.strip('"').upper()
    instance, dot, inner = name.partition(".")
    if dot and parts:
        if instance not in parts:
            raise wrong(row, f"there is no instance {instance}", f"Known here: {', '.join(parts)}.")
        return parts[instance], inner
    return part, name
