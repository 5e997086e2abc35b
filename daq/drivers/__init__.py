"""Drivers, one family per wire: GigE Vision (Aravis), serial line (pyserial), GPIO (libgpiod).

Drivers fulfil the protocols of ``daq.devices``; who runs them on which rig is for ``server.rig`` to know.
"""
