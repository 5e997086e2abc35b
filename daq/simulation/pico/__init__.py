"""The far end of the pulse generator's wire: the firmware itself, in a process of this computer or in an emulated Pico.

It knows ``daq.shot`` and the firmware's sources, and no driver.
"""
