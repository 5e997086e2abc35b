"""Colours that mean the same in every figure."""

VIEW_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#000000")
"""Of the views, in order; a rig has eight at most."""
FRAME_COLOURS = {"A": "#1f4e9c", "B": "#c0392b"}
"""Of the exposures of a double frame."""
