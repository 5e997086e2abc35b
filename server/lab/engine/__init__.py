"""Engines run the work functions of jobs outside the process that asks for them; the home of ``distributed``.

``task`` says what a task and an engine are. The room may import ``server.rig`` and the errors of ``server.lab``; the
runner, the server and commands import it.
"""
