"""The simulated bench: the other end of every wire. Real drivers always run against it."""
