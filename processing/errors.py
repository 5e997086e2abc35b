"""BadInput: what was asked for, or the files it was asked of, is wrong, and not the program."""


class BadInput(Exception):
    """Bad usage or bad input, which whoever asked can put right; the text names file or value, and limit."""
