"""From images of a target at known places to the camera of every view, and how far to trust it."""
