"""What passages themselves suggest about rail and wheels: candidates that no grid of the library could hold."""

from turnout.mismatch.track.flats import flats
from turnout.mismatch.track.polygons import polygons
from turnout.mismatch.track.rail_scan import rail_scan
from turnout.mismatch.track.short_polygons import short_polygons
from turnout.mismatch.track.short_waves import short_waves


def geometry_scan(case, fit, families=None):
    """Candidates of ``families`` (None: all) for the residual of ``fit``."""
    found = list(rail_scan(case, fit, families))
    if families is None or "rail_corrugation" in families:
        found += short_waves(case, fit)
    if families is None or "wheel_flat" in families:
        found += flats(case, fit)
    if families is None or "out_of_round" in families:
        found += (*polygons(case, fit), *short_polygons(case, fit))
    return tuple(found)
