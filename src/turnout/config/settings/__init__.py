"""Settings of the methods: one dataclass per section, each field with unit, limits and the reason of its default."""

import pkgutil
from functools import cache
from importlib import import_module


@cache
def parts() -> dict[str, type]:
    """Settings class of every section: the module ``<section>.py`` holds the class ``<Section>Settings``.

    >>> parts()["fleet"].__name__
    'FleetSettings'
    """
    classes = {}
    for module in sorted(m.name for m in pkgutil.iter_modules(__path__) if m.name != "setting"):
        name = "".join(word.capitalize() for word in module.split("_")) + "Settings"
        classes[module] = getattr(import_module(f"{__name__}.{module}"), name)
    return classes
