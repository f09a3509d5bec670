"""Stages of the workflow: each takes the raw files of one unit and returns rows of the registry."""
