"""The demonstration fleet: three turnouts over three years, with seasons, maintenance, faults and one true drift.

Raw files go to ``raw/``, the truth to ``truth/``, which the workflow does not read.
"""
