"""Advice that takes a model, or a run: what the states' linearised model, a float's resolution and costs tell."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kfgen.advice.costs import cheaper
from kfgen.errors import Advice, KfgenError
from kfgen.spec import warnings
from kfgen.spec.advice import wanted
from kfgen.spec.types import Spec

if TYPE_CHECKING:
    from kfgen.generate import Generated

RUN = ("far_origin", "precision", "robust_start", "sigma_angle", "unobservable")
"""The advice that takes a run."""


def advise(spec: Spec, generated: Generated | None = None) -> list[Advice]:
    """All advice on a valid spec that it does not silence, in the order of its lines. generated: what was built of it,
    where costs are to be judged too. A model that does not get through a simulated run is not judged by one."""
    found = list(warnings(spec))
    if any(name not in spec.advice for name in RUN):
        from kfgen.advice import observability, resolution, spread
        from kfgen.advice.track import follow

        try:
            tracks = follow(spec)
        except KfgenError:
            tracks = []
        if tracks:
            found += [*observability.advice(spec, tracks), *spread.advice(spec, tracks)]
            found += resolution.advice(spec, tracks)
    if generated is not None:
        found += cheaper(spec, generated)
    return wanted(spec, found)
