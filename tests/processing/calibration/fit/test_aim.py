"""A camera told by what its image shows is the same camera, and its fit reaches the end of the valley."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.calibration.fit.aim import Aim
from processing.calibration.fit.pinhole_fit import PARAMETER_NAMES, fit_pinhole
from processing.calibration.observation import stacked
from processing.geometry import FloatArray
from tests.support.calibration_cases import paper_camera, seen_planes, true_errors_px

PARAMETERS = np.array(
    [0.1, -0.7, 0.02, 3.0, -2.0, 320.0, 19000, 19100, 1050, 480, 0.6, 20, 8e-4, -6e-4, 0.3, 0.05, 0.2]
)
MIDDLE_MM = np.array([0.5, -1.0, 2.0])
Z_MM = (-4.0, -2.0, 0.0, 2.0, 4.0)

angle_rad = st.floats(-1.0, 1.0)


@given(turn=st.tuples(angle_rad, angle_rad, angle_rad), tilt=st.tuples(angle_rad, angle_rad), behind=st.booleans())
@settings(max_examples=40)
def test_values_are_the_parameters_in_other_words(
    turn: tuple[float, float, float], tilt: tuple[float, float], behind: bool
) -> None:
    parameters = PARAMETERS.copy()
    parameters[:3], parameters[15:] = turn, np.array(tilt) / 3
    parameters[5] *= -1 if behind else 1
    for known in (parameters, parameters[:15]):
        begun = known.copy()
        begun[:3] += 0.1
        aim = Aim.at(begun, MIDDLE_MM)
        np.testing.assert_allclose(aim.parameters(aim.values(known)), known, rtol=1e-7, atol=1e-9)


def test_derivatives_follow_the_parameters() -> None:
    aim = Aim.at(PARAMETERS, MIDDLE_MM)
    values = aim.values(PARAMETERS)
    step = np.random.default_rng(1).normal(size=17) * 1e-4
    here, derivatives = aim.linearised(values)
    np.testing.assert_array_equal(here, aim.parameters(values))
    predicted = here + derivatives @ step
    scale = np.maximum(np.abs(PARAMETERS), 1e-3)
    np.testing.assert_allclose(aim.parameters(values + step) / scale, predicted / scale, atol=2e-4)
    assert derivatives.shape == (len(PARAMETER_NAMES), len(PARAMETER_NAMES))


@pytest.mark.parametrize(
    ("tilt_rad", "distortion"),
    [
        ((0.0, 0.05), (0.6, 20.0, 8e-4, -6e-4, 0.0)),
        ((0.05, 0.2), (0.6, 20.0, 8e-4, -6e-4, 0.0)),
        ((-0.1, -0.25), (2.0, 0.0, 0.0, 0.0, 0.0)),
        ((0.05, 0.2), (4.0, 400.0, 4e-3, -3e-3, 0.0)),
    ],
)
def test_tilt_and_distortion_are_told_apart(tilt_rad: tuple[float, float], distortion: tuple[float, ...]) -> None:
    """Fitted as they stand, focal length, rotation and tilt stop half-way, up to 3 px off."""
    camera = replace(paper_camera(45.0, distortion=distortion), tilt_rad=tilt_rad)
    fitted = fit_pinhole(*stacked(seen_planes(camera, z_mm=Z_MM)), camera.image_size_px, tilted=True)
    assert true_errors_px(fitted.camera, camera).mean() < 0.006
    assert fitted.used.all()


def test_another_principal_point_shows_almost_the_same() -> None:
    camera = paper_camera(30.0, distortion=(0.0,) * 5)
    plain = fit_pinhole(*stacked(seen_planes(camera, noise_px=0.0, z_mm=Z_MM)), camera.image_size_px).camera
    turn: FloatArray = np.concatenate([np.zeros(3), plain.translation_mm, plain.camera_matrix[[0, 1], [0, 1]]])
    parameters = np.concatenate([turn, plain.camera_matrix[:2, 2], np.zeros(7)])
    aim = Aim.at(parameters, np.zeros(3))
    moved = aim.with_centre(parameters, np.array([799.5, 599.5]))
    np.testing.assert_allclose(moved[8:10], [799.5, 599.5])
    np.testing.assert_allclose(aim.values(moved)[:8], aim.values(parameters)[:8], atol=1e-9)
    assert np.abs(moved[15:]).max() > 0.001
