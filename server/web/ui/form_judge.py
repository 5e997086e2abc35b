"""FormJudge: what speaks against the form of the next run; looked at once for all tabs, whatever page they show."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass

from server.lab.desk.reason import UNSEEN, Reason
from server.lab.desk.rig_state import RigState, RigWord
from server.lab.desk.visitor import Role, Visitor
from server.lab.services import Context
from server.lab.starting.preflight_list import Check, CheckResult, check_control, checks_of
from server.lab.starting.readiness import reasons_against, reasons_against_visitor
from server.web.ui.draft import DraftStore

_LOOK_AGAIN_S = 5.0
"""Disk and references change without a word."""
_STALE_S = 15.0
"""A disk that hangs holds up a look; then nobody knows."""
_Rig = tuple[RigWord, tuple[Reason, ...]]
"""What the rig is up to, and what speaks against a start."""
_NO_PLAN = Reason(
    code="form",
    text="a field of the form is empty or out of its limits",
    remedy="correct what is red in the form of the page Run",
)


@dataclass(frozen=True, eq=False)
class Verdict:
    """What a look has found, each another: the rig, reasons against a start, the first one first, and all else."""

    rig: _Rig
    reasons: tuple[Reason, ...]
    checks: tuple[Check, ...]


class FormJudge:
    """Belongs to a draft, as all tabs do; asked by their timers.

    Parameters
    ----------
    context : Context
        The application.
    draft : DraftStore
        The form.
    now_s : Callable[[], float]
        A clock that never goes back.
    """

    def __init__(self, context: Context, draft: DraftStore, now_s: Callable[[], float] = time.monotonic) -> None:
        self._context, self._draft, self._now_s = context, draft, now_s
        self._verdict: Verdict | None = None
        self._basis: object = None
        self._begun_s = self._found_s = 0.0
        self._is_looking = False

    @property
    def verdict(self) -> Verdict | None:
        """What was found last; None: nobody knows."""
        return self._verdict if self._now_s() - self._found_s < _STALE_S else None

    async def refresh(self) -> None:
        """Look again whenever form or rig has changed, and every few seconds; nothing where a look goes on."""
        basis = self._rig, self._draft.version
        is_fresh = self._basis == basis and self._now_s() - self._begun_s < _LOOK_AGAIN_S
        if self._is_looking or is_fresh:
            return
        self._is_looking = True
        self._basis, self._begun_s = basis, self._now_s()
        try:
            self._verdict, self._found_s = await asyncio.to_thread(self._look), self._now_s()
        finally:
            self._is_looking = False

    def state(self, who: Visitor) -> RigState:
        """Rig, form, and whether this person may start: ready only where his start would not be refused."""
        desk, verdict = self._context.desk, self.verdict
        if verdict is None or verdict.rig != self._rig:
            return desk.state_for(desk.state.reasons or (UNSEEN,))
        of_who = reasons_against_visitor(self._context, who)
        is_viewer = who.role is Role.VIEWER  # he starts nothing anyway: what the rig lacks comes first
        return desk.state_for((*verdict.reasons, *of_who) if is_viewer else (*of_who, *verdict.reasons))

    def checks(self, who: Visitor) -> tuple[Check, ...]:
        """Everything that was looked at, with who holds control."""
        verdict = self.verdict
        return (check_control(self._context, who), *verdict.checks) if verdict else ()

    @property
    def _rig(self) -> _Rig:
        rig = self._context.desk.state
        return rig.state, rig.reasons

    def _look(self) -> Verdict:
        rig = self._rig
        try:
            plan = self._draft.plan
        except (ValueError, TypeError):
            return Verdict(rig, (_NO_PLAN,), (Check(name="Form", finding=CheckResult.REFUSED, text=_NO_PLAN.text),))
        reasons = reasons_against(self._context, plan)
        return Verdict(rig, reasons, checks_of(self._context, plan, reasons))
