"""What all tests share: property tests try the same examples in every run, and however slow the machine is.

``TEST_OPTIONS=--hypothesis-profile=others`` tries others.
"""

from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("others", deadline=None)
settings.load_profile("repeatable")
