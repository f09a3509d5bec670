"""The drawings of a page, one file each: rows of the registry in, SVG out."""
