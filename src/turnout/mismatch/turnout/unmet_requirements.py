"""What recordings cannot show of the effects in the catalogue, by the requirements that each of them states."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

from turnout import physics
from turnout.mismatch.turnout.candidates.catalogue import recorded_quantities, sites_of
from turnout.physics.hypothesis import ContactSite, TrainSite

if TYPE_CHECKING:
    from turnout.mismatch.turnout.case_data import CaseData
    from turnout.physics.requirement import Requirement


@dataclass(frozen=True)
class UnmetRequirement:
    """An ``effect`` of the catalogue, or the part of it in ``words``, with the ``requirements`` that are not met."""

    effect: str
    words: str
    requirements: tuple[Requirement, ...]

    @property
    def lack(self) -> str:
        """What the recordings lack, in words."""
        return " and ".join(r.lack for r in self.requirements)

    @property
    def measurement(self) -> str:
        """The measurement that supplies it."""
        return " and ".join(r.measurement for r in self.requirements)


def unmet_requirements(data: CaseData, families: Collection[str] | None = None) -> tuple[UnmetRequirement, ...]:
    """Effects that the recordings of a case cannot show, in the order of the catalogue.

    Parameters
    ----------
    data : CaseData
        Its recordings.
    families : collection of str or None
        Effects to which the candidates are restricted; None: all.

    Returns
    -------
    tuple of UnmetRequirement
        Effects that cannot be at this track, as those of a blade without one, are left out.
    """
    recorded, sites, unexamined = recorded_quantities(data), list(sites_of(data)), []
    for effect in physics.TERMS:
        if not effect.asked or (families is not None and effect.name not in families):
            continue
        of_wheels = not effect.site_types or {ContactSite, TrainSite} & set(effect.site_types)
        if not of_wheels and not any(isinstance(site, effect.site_types) for site in sites):
            continue
        unmet = [r for r in effect.requirements if not r.is_met(recorded)]
        of_whole = tuple(r for r in unmet if not r.part)
        if of_whole:
            title = effect.title()
            unexamined.append(UnmetRequirement(effect.name, title[0].lower() + title[1:], of_whole))
            continue
        for part in dict.fromkeys(r.part for r in unmet):
            unexamined.append(UnmetRequirement(effect.name, part, tuple(r for r in unmet if r.part == part)))
    return tuple(unexamined)
