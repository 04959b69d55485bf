"""Checks the log of a test against the rules of the drive contract. Needs no ROS."""

from dataclasses import dataclass
from enum import Enum

from .log import Log
from .rules import RULES, Terms


class RuleResult(Enum):
    """Result of a rule."""

    KEPT = "kept"
    BROKEN = "broken"
    UNTESTED = "not tested"


@dataclass(frozen=True)
class Verdict:
    """Result of one rule, and the reason."""

    rule: str
    outcome: RuleResult
    reason: str = ""


def judge(log: Log, terms: Terms) -> list[Verdict]:
    """The result of every rule."""
    verdicts = []
    for rule in RULES:
        reason = rule.judge(log, terms)
        if reason is None or (not reason and not log.sent and rule.name not in ("connected", "alive")):
            verdicts.append(Verdict(rule.name, RuleResult.UNTESTED))
        else:
            verdicts.append(Verdict(rule.name, RuleResult.BROKEN if reason else RuleResult.KEPT, reason))
    return verdicts


def exit_code(verdicts: list[Verdict], log: Log) -> int:
    """0: every rule that was tested is kept; 1: one is broken; 2: nothing could be tested."""
    if not log.sent and not log.incompatible:
        return 2
    return int(any(each.outcome is RuleResult.BROKEN for each in verdicts))
