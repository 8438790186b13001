"""Has moved to coupler.scenario.rule_model."""

from contact.half.moved import moved

__getattr__ = moved(__name__, "coupler.scenario.rule_model")
