"""What is made of the shots of a run by themselves, as its plan states it: checked, spelled out, and followed.

May import ``server.lab``; what starts runs, and pages, import it.
"""
