"""Filters, windows, spectra and the limits of coherence; without any knowledge of tracks."""
