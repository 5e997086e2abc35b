"""HEAD of whatever can be read, and JSON that is sent again only when it has changed."""

from tests.support.serving import Serving, plan_of


def test_head_is_get_without_a_body(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    for path in ("/api/rig", "/api/runs", f"/api/runs/{run_id}", f"/api/runs/{run_id}/header", "/api/openapi.json"):
        read, head = server.http.get(path), server.http.head(path)
        assert (head.status_code, head.content) == (200, b""), path
        assert head.headers["content-type"] == read.headers["content-type"]
        assert int(head.headers["content-length"]) == len(read.content)
    assert server.http.head("/api/runs").headers["x-total-count"] == "1"
    assert server.http.head("/api/runs/none").status_code == 404
    assert server.http.head("/api/events").status_code == 405
    assert server.http.head("/api/rig/abort").headers["allow"] == "POST"


def test_json_that_is_known_is_not_sent_again(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    first = server.http.get(f"/api/runs/{run_id}")
    known = {"If-None-Match": first.headers["etag"]}
    again = server.http.get(f"/api/runs/{run_id}", headers=known)
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == first.headers["etag"]
    assert server.http.get("/api/runs", headers=known).status_code == 200
    weak = {"If-None-Match": f'"other", W/{first.headers["etag"]}'}
    assert server.http.get(f"/api/runs/{run_id}", headers=weak).status_code == 304
    assert server.http.head(f"/api/runs/{run_id}", headers=known).status_code == 304
    before = server.http.get("/api/runs")
    server.run_to_its_end(plan_of(shots=1))
    changed = server.http.get("/api/runs", headers={"If-None-Match": before.headers["etag"]})
    assert (changed.status_code, len(changed.json())) == (200, 2)


def test_what_is_no_reading_has_no_tag(server: Serving) -> None:
    assert "etag" not in server.http.post("/api/rig/abort").headers
    assert "etag" not in server.http.get("/api/runs/none").headers
