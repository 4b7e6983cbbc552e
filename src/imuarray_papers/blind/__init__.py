"""Recordings with an injected effect, to test a diagnosis by somebody who did not write it.

Nothing here shares code with the measurement model, the simulation or the estimators: the
rigid-body formula, its derivatives and every effect are written out once more.
"""
