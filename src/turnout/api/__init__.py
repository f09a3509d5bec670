"""Functions for scripts and notebooks, offered as names of ``turnout``; thin over those of the packages."""
