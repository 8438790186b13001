"""From settings and what rules do to the settings that follow."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from coupler.rules.model import Action, Give, Substeps, UseScheme, Window
from coupler.schemes.settings import Settings

# A rule that fires in every window halves again and again: beyond these a factor of the window is a mistake.
FACTORS = (2.0**-20, 2.0**20)


def applied(settings: Settings, actions: Iterable[Action]) -> Settings:
    """The settings after these actions, in order.  Retry and Stop change none."""
    for action in actions:
        settings = _one(settings, action)
    return settings


def _one(settings: Settings, action: Action) -> Settings:
    match action:
        case Substeps(half=half, count=count):
            # fault: rules: substeps without an upper bound -> n = max(round(settings.substeps[half] * count.times), 1)
            #   | coupler/test_rules
            n = max(round(count.of(settings.substeps[half])), 1)
            return replace(settings, substeps={**settings.substeps, half: n})
        case Give(half=half, name=name, value=value):
            known = settings.inputs.get(half, {})
            return replace(settings, inputs={**settings.inputs, half: {
                **known, name: value.of(known.get(name, action.start))}})
        case UseScheme(scheme=scheme):
            return replace(settings, scheme=scheme)
        case Window(size=size) if math.isnan(size.to):
            factor = min(max(size.of(settings.window_factor), FACTORS[0]), FACTORS[1])
            return replace(settings, window_factor=factor)
        case Window(size=size):
            return replace(settings, window_cap=size.to)
    return settings
