"""What is wrong with computer and rig, and how to mend it: one finding after the other.

It may import ``rig``, ``processing`` and ``daq``; the command ``doctor`` prints it.
"""
