"""What changed between two specs, or a spec and files that were generated: interface, behaviour, cost."""

from kfgen.difference.behaviour import Behaviour, behave
from kfgen.difference.interface import Change, changes
from kfgen.difference.side import Side, sides

__all__ = ["Behaviour", "Change", "Side", "behave", "changes", "sides"]
