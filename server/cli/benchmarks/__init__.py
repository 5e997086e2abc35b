"""What the command ``bench`` measures of runs on disk, of whole commands and of jobs.

It may import everything but the commands themselves.
"""
