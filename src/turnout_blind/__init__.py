"""The blind proof: an independent generator of measuring campaigns with concealed effects, their seals, and the scores.

Nothing here imports turnout.simulate, turnout.physics or turnout.mismatch: what diagnoses must not be what conceals.
"""
