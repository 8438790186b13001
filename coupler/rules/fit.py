"""Whether the halves of a run have what its rules look at and change."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from coupler.fmu.half import Block
from coupler.scenario.options import Scheme
from coupler.scenario.rule_model import COUPLER, INCREMENT, RATE, Give, Rule, UseScheme, outputs
from coupler.schemes.sweep import FEW

Blocks = Mapping[str, Mapping[str, Block]]


def unfit(rules: Iterable[Rule], blocks: Blocks) -> list[str]:
    """A sentence on everything that a half lacks.  blocks : half ("thermal", "mechanical") -> what it has."""
    return [f"rule {rule.name!r}: {lack}" for rule in rules for lack in _lacks(rule, blocks)]


def schemes_of(rules: Iterable[Rule]) -> frozenset[Scheme]:
    """Those that rules may change to."""
    return frozenset(a.scheme for rule in rules for a in rule.do if isinstance(a, UseScheme))


def _lacks(rule: Rule, blocks: Blocks) -> Iterator[str]:
    for monitor in sorted(rule.monitors - COUPLER.keys()):
        told = outputs([monitor])
        if told and not any(_has(blocks, name, monitor) for name in ((RATE, INCREMENT) if monitor == RATE else told)):
            yield f"the {monitor.partition('.')[0]} half gives out no {monitor.partition('.')[2]}"
    gives = [(a.half, a.name) for a in rule.do if isinstance(a, Give)]
    for half, name in gives + ([(rule.drive.half, rule.drive.name)] if rule.drive else []):
        # fault: rules: an input that a half does not have goes unnoticed -> if name in blocks[half] and
        #   blocks[half][name].causality != "input": | coupler/test_rules_fit
        if name not in blocks[half] or blocks[half][name].causality != "input":
            yield f"the {half} half has no input {name}"


def _has(blocks: Blocks, output: str, monitor: str) -> bool:
    """Whether a half gives out this number, or so many of them."""
    half, _, name = output.partition(".")
    block = blocks[half].get(name)
    if block is None or block.causality != "output" or block.kind != "Real":
        return False
    if not monitor.endswith("]"):
        return block.shape == ()
    return len(block.shape) == 1 and int(monitor[monitor.rindex("[") + 1:-1]) <= block.shape[0] <= FEW
