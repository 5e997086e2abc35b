"""What a worker loads to do the work of jobs."""

from tests.support.fresh_interpreter import modules_after, packages_of


def test_a_worker_loads_neither_web_nor_commands() -> None:
    modules = modules_after("import server.lab.tasks")
    assert "processing.runs.pipeline" in modules
    assert not {module for module in modules if module.startswith(("server.cli", "server.web"))}
    assert not packages_of(modules) & {"fastapi", "starlette", "nicegui", "uvicorn"}
