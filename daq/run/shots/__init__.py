"""One shot of a run or a live view: fired at its time, collected, and looked at before anybody believes it.

May import ``daq.run`` and what that may import; ``daq.run`` and ``server.rig`` import it.
"""
