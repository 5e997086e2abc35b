"""Shots become volumes: one volume per exposure, parts of one, the mean of many.

It may import what lies beside this room, but for what measures or checks runs.
"""
