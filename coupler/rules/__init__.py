"""Rules: data that say what a run is to do where it shows this or that."""

from contact.half.moved import alias_moved

alias_moved(__name__, model="coupler.scenario.rule_model")
