"""Images from elsewhere become a run and a calibration set: what a manifest states, and what is made of it.

It may import what ``processing.runs`` may.
"""
