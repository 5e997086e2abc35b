"""What the desk has always in sight: readiness, alarms, control, the beat of the server.

A router per resource; they may import ``lab`` and what all routers share.
"""
