"""The far end of a camera's wire: a GigE Vision device that any client opens by its address.

It knows ``daq.shot`` and ``daq.timing``, and no driver.
"""
