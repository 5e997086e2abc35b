"""Tables of the page: dense, with a badge for outcomes and buttons for what can be done."""

from nicegui import ui

from server.web.ui.visiting import VIEWERS_MAY, is_viewer

_BADGE = '<q-td :props="props"><q-badge :color="props.row.colour" :label="props.value" /></q-td>'
SHOW = "Show"
"""The action that only looks."""
_ACTIONS = """<q-td :props="props" auto-width><q-btn v-for="action in props.value" :key="action" :label="action" LOCK
dense flat no-caps size="sm" color="primary" @click.stop="$parent.$emit('act', { ...props.row, action })" /></q-td>"""
_LOCK = f""" :disable="action !== '{SHOW}'" :title="action !== '{SHOW}' ? '{VIEWERS_MAY}' : ''" """


def table_of(*columns: tuple[str, str]) -> ui.table:
    """A table with these columns, by field and title; ``outcome`` is a badge, ``actions`` are buttons for operators."""
    described = [
        {"name": name, "label": label, "field": name, "align": "left", "classes": name, "headerClasses": name}
        for name, label in columns
    ]
    table = (
        ui.table(columns=described, rows=[], row_key="id").classes("w-full").props("dense flat wrap-cells hide-bottom")
    )
    table.props('rows-per-page-options="[0]" :pagination="{rowsPerPage: 0}"')
    table.add_slot("body-cell-outcome", _BADGE)
    table.add_slot("body-cell-actions", _ACTIONS.replace("LOCK", _LOCK if is_viewer() else ""))
    return table
