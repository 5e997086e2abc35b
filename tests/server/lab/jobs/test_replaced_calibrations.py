"""Jobs say so where their calibration was replaced under its name."""

import json
from pathlib import Path

from server.lab.calibrations import CalibrationStore
from server.lab.jobs.job import calibration_job, check_job, reconstruction_job
from server.lab.jobs.replaced_calibrations import replaced_since


def test_a_calibration_that_was_replaced_under_its_name_is_no_longer_that_of_its_jobs(tmp_path: Path) -> None:
    (tmp_path / "calibrations").mkdir()
    calibrations = CalibrationStore(tmp_path / "calibrations")
    (tmp_path / "run" / "results" / "mlos-1").mkdir(parents=True)
    (tmp_path / "run" / "results" / "mlos-1" / "settings.json").write_text('{"calibration": "cal-1"}')
    fitted = calibration_job("run", "cal", "pinhole").model_copy(update={"result": {"calibration": "cal-1"}})
    jobs = [
        fitted,
        check_job("run", 0, "cal", content="cal-1"),
        reconstruction_job("run", 0, "cal", "mlos-1", {}),
        reconstruction_job("run", 1, "cal", "nothing-yet", {}),
    ]
    for content, replaced in (("cal-1", set()), ("cal-2", {job.id for job in jobs[:3]})):
        (tmp_path / "calibrations" / "cal.json").write_text(json.dumps({"id": content}))
        assert replaced_since(calibrations, tmp_path, jobs) == replaced
