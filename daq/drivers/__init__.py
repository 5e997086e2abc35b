"""One module per wire: GigE Vision (Aravis), serial line (pyserial), GPIO (libgpiod)."""
