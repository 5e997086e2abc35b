"""Ages in words. Pure."""


def age_text(age_s: float) -> str:
    """A time in its largest unit."""
    for unit_s, unit in ((86_400, "d"), (3600, "h"), (60, "min")):
        if age_s >= unit_s:
            return f"{age_s / unit_s:.0f} {unit}"
    return f"{max(0.0, age_s):.0f} s"
