"""The command line: what a command is told, what it does and what it prints.

It may import everything; nothing imports it.
"""
