"""Figures of a spray as a whole: how large its droplets are, how fast, where its liquid goes. Arrays in, a Figure out.

It may import what ``figures`` may; reports and studies call it.
"""
