"""The live view: shots at a low rate that nobody records. ``live_session`` is the front.

It shoots as a run does, with ``daq.run``, and writes no file.
"""
