"""Server: REST, events, the operator's page and the command line; assembles daq and processing, owns no physics.

``cli`` > ``web`` > ``lab`` > ``pictures``, ``demo``, ``doctor`` > ``rig``: each may import what stands to its right.
"""
