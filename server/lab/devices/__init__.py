"""The devices of the rig as an operator sees them: a card for each, the budget of the network, and the doctor.

They may import ``desk``, the monitor and ``doctor``; they know neither HTTP nor the page.
"""
