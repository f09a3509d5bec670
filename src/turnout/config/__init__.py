"""Configuration of the fleet: read, checked, merged and hashed.

``load_configuration("config")`` returns a ``Configuration``. Its ``turnout(id)`` returns a frozen ``TurnoutConfig``.
``with_raw(turnout, raw_root)`` adds the campaigns and trains that are listed in the raw folder.
"""

from turnout.config.campaign_notes import unlisted_campaign, with_raw
from turnout.config.configuration import Configuration
from turnout.config.events import Event
from turnout.config.load import load_configuration
from turnout.config.turnout import Campaign, HammerConfig, PassageConfig, Section, TurnoutConfig

__all__ = [
    "Campaign",
    "Configuration",
    "Event",
    "HammerConfig",
    "PassageConfig",
    "Section",
    "TurnoutConfig",
    "load_configuration",
    "unlisted_campaign",
    "with_raw",
]
