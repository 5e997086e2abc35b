"""Random sprays: the paper's nozzles with sheet and break-up, and clouds of droplets for studies.

They know ``spray`` and random numbers, no cameras; scenes, studies and tests take them.
"""
