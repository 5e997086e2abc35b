"""Starting what makes light, and ending it: what speaks against it, starting once, ABORT.

It may import ``services`` and what that is made of; nothing of the laboratory imports it.
"""
