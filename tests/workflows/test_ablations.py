"""Tuned rules switched off: the neutral value acts, and the program is as before afterwards."""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module

from proof import ablations
from tribodyn.hbm.continuation import curve_segment
from tribodyn.hbm.continuation.resonance_peak import AtPeak


def test_a_neutral_value_acts_and_is_taken_back():
    before = curve_segment.RULES
    with ablations.without("continuation.curve_segment.CurveRules", "fold_turn", 0.0):
        assert curve_segment.RULES.fold_turn == 0.0
        assert curve_segment.RULES.largest_slant == before.largest_slant
    assert curve_segment.RULES is before
    assert curve_segment.CurveRules() == before
    with ablations.without("continuation.resonance_peak.AtPeak", "max_refined", 1):
        assert AtPeak("tip", 1.0, 2.0).max_refined == 1
    assert AtPeak("tip", 1.0, 2.0).max_refined == 3


def test_every_rule_that_is_listed_is_a_field_with_another_default():
    for place, rules in ablations.RULES.items():
        name, _, kind = place.rpartition(".")
        fields_of_rules = {
            field.name: field.default for field in fields(getattr(import_module(f"tribodyn.hbm.{name}"), kind))
        }
        for rule, neutral in rules.items():
            assert fields_of_rules[rule] != neutral, rule


def test_a_rule_that_finds_hidden_folds_changes_a_branch_problem():
    with ablations.without("continuation.curve_segment.CurveRules", "fold_turn", 0.0):
        changed = ablations.outcomes([18], [])
    assert changed != ablations.outcomes([18], [])
