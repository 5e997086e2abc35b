"""What commands on recorded runs share: recipes, and many runs at once.

May be imported by the commands alone.
"""
