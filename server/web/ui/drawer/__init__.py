"""The drawer: jobs and events, beside every page.

Its modules may import ``lab`` and what all pages share.
"""
