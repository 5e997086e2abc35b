"""ThemeButton: dark or light. The browser remembers, and follows the system until somebody chooses."""

from nicegui.element import Element


class ThemeButton(Element, component="theme_button.js"):
    """Needs nothing of the server."""
