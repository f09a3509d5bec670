"""Draw the panels of a page: rows of the registry in, SVG out."""
