"""What an operator has always in sight: the state of the rig in one word, what is wrong, and what was acknowledged.

It is told of lamps, of acquisition and of what speaks against a start, and asks nobody; ``services`` may import it.
"""
