"""The demonstration fleet: three turnouts over three years, with seasons, maintenance, faults and one true drift.

Everything it knows goes into ``truth/``, where the pipeline does not read; raw files into ``raw/``.
"""
