"""Jobs of processing: what was asked for, the table that keeps it, and how far it is.

May import what lies in ``server.lab`` beside the rooms; the rest of the laboratory, API and page import it.
"""
