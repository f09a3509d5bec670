"""Draw the panels of a page: rows of the registry in, SVG out.

A new panel of a hammer test is one file with a function and one line in ``HAMMER_PANELS``.
"""

from collections.abc import Callable

from turnout.report.panels.hammer import (
    HammerTest,
    coherence_panel,
    decay_panel,
    impacts_panel,
    receptance_panel,
    stabilisation_panel,
)
from turnout.report.panels.phase import phase_panel

# Each function returns SVG, "" where there is nothing to draw. Pages and figures show them in this order.
HAMMER_PANELS: tuple[Callable[[HammerTest], str], ...] = (
    receptance_panel,
    phase_panel,
    coherence_panel,
    decay_panel,
    stabilisation_panel,
    impacts_panel,
)
