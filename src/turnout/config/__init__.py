"""Configuration: what the user says about the fleet, checked, merged and hashed.

``load_configuration("config")`` gives a ``Configuration``; its ``turnout(id)`` a frozen ``TurnoutConfig``;
``with_raw(turnout, raw_root)`` the same with the campaigns and trains noted in its raw folder.
"""

from turnout.config.campaign_notes import unnoted
from turnout.config.events import Event
from turnout.config.load import Configuration, load_configuration, with_raw
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
    "unnoted",
    "with_raw",
]
