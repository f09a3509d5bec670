"""Figures and pages: static HTML with drawings in it, made from the registry alone."""
