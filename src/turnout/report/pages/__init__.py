"""Render whole pages, one module each."""
