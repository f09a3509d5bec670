"""A layout of one section with hammer tests, the least that a turnout needs."""

LAYOUT = """\
sections:
  A7: {panel: CP, track: main, position: 24.6}
hammer:
  files: "hammer/{campaign}/{section}_{test}.{ext}"
  force: force
  response: rail
  channels:
    force: {source: force, quantity: force, unit: N}
    rail: {source: rail, quantity: acceleration, unit: m/s²}
"""
