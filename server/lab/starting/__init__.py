"""Starting what makes light: what speaks against it, and starting it once.

It may import ``services`` and what that is made of; nothing of the laboratory imports it.
"""
