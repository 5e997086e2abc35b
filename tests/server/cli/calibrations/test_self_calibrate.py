"""``tomoshadow self-calibrate``: what it tells people; what it does is tried beside ``check``."""

from server.cli.calibrations.self_calibrate import views_table


def test_people_get_a_line_per_view() -> None:
    still = {"correction_px": 0.0, "disparity_before_px": 0.04, "disparity_after_px": 0.02, "verdict": "good"}
    moved = {"correction_px": 2.0, "disparity_before_px": 1.98, "disparity_after_px": 0.03, "verdict": "usable"}
    result = {"calibration": "new.json", "id": "cal-2", "parent": "cal-1", "views": {"view1": still, "view2": moved}}
    assert views_table(result).splitlines() == [
        "view   verdict  correction [px]  disparity before [px]  after [px]",
        "view1  good                0.00                   0.04        0.02",
        "view2  usable              2.00                   1.98        0.03",
        "cal-2: new.json, corrects cal-1",
    ]
