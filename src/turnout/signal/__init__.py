"""Filters, windows, spectra and the limits of what spectra can say; knows nothing of tracks."""
