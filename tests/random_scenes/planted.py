"""Faults planted for a test: a half that is told something else than the scene says."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

import contact.half.contact_client
from coupler.scenario import Scenario


def told_otherwise(monkeypatch: pytest.MonkeyPatch, role: str, change: Callable[[dict[str, Any]], None]) -> None:
    """Let `change` write into the model.json of a half before the half reads it."""
    right = Scenario.write_half

    def wrong(scenario: Scenario, half: str, directory: Any) -> str:
        models = copy.deepcopy(dict(scenario.models))
        if half == role:
            change(models[role])
        return right(replace(scenario, models=models), half, directory)

    monkeypatch.setattr(Scenario, "write_half", wrong)


def pairs_otherwise(monkeypatch: pytest.MonkeyPatch, **factors: float) -> None:
    """Let the contact service be told numbers of pairs (eps_N, mu, ...) multiplied by these factors."""
    right = contact.half.contact_client.register_message

    def wrong(interface: Any, *how: Any) -> Any:
        pairs = tuple(replace(p, **{k: getattr(p, k) * v for k, v in factors.items()}) for p in interface.pairs)
        return right(replace(interface, pairs=pairs), *how)

    monkeypatch.setattr(contact.half.contact_client, "register_message", wrong)
