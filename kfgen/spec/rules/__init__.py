"""What must hold beyond single keys: every rule in its module, called here in order."""

from __future__ import annotations

from kfgen.spec.names import check_identifiers, check_name
from kfgen.spec.rules import compensated, covariance, filters, given, modes, rotations, structure, values
from kfgen.spec.rules.facts import Facts
from kfgen.spec.scopes import Scopes
from kfgen.spec.types import Spec
from kfgen.spec.walk import Walker


def check(walker: Walker, spec: Spec) -> None:
    """Report every mistake of a spec that has been built."""
    if spec.name:
        at = walker.values.get("name", spec.place)
        check_name(spec.name, at, walker.problems, headers=True)
    scopes = Scopes(walker, spec)
    scopes.check()
    facts = Facts(walker, spec, scopes)
    structure.check(facts)
    values.check(facts)
    covariance.check(facts)
    filters.check(facts)
    modes.check(facts)
    compensated.check(facts)
    given.check(facts)
    rotations.check(facts)
    check_identifiers(spec, walker.problems)
