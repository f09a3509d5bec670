"""What is wrong with the files or recordings of a whole campaign, and would be taken for an effect."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from turnout.mismatch.turnout.campaign import CampaignInput


class LayoutFault(Protocol):
    """Something that the layout states wrongly, or that a logger does to all its channels; false if there is none.

    It is corrected before effects are sought, and stated in the finding.
    """

    @property
    def recording_type(self) -> str:
        """What it concerns, in a few words. A campaign is corrected once for each."""

    def __bool__(self) -> bool: ...

    def sentences(self) -> list[str]:
        """What was found, what was done, and what to do: texts without their full stops."""

    def correct(self, campaign: CampaignInput) -> CampaignInput:
        """The campaign as it would be without the fault.

        Parameters
        ----------
        campaign : CampaignInput
            As the layout describes it.

        Returns
        -------
        CampaignInput
        """
