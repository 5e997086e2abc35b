"""REST: one router per resource. Handlers validate, call, and return a view; blocking ones run in threads.

They may import ``lab`` and ``pictures``, and nothing of ``ui``.
"""
