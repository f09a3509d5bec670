"""What the rules ask about damage of the registry."""

from turnout.registry.damage import damage_stamp

__all__ = ["damage_stamp"]
