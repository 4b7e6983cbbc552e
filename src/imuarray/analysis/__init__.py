"""The analyses of one recording: from a `Recording` to labelled datasets.

The commands and the notebook call the same functions.
"""
