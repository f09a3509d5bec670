"""The blind proof: generate measuring campaigns with concealed effects, seal their truths, and score the diagnosis.

Nothing here imports turnout.simulate, turnout.physics or turnout.mismatch. The generator is independent of the
diagnosis.
"""
