"""What commands on recorded runs share: recipes, and many runs at once; and the command that links their droplets.

May be imported by the commands alone.
"""
