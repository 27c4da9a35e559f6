"""Close-ups of drops beside an independent path tracer's. Its glints are counts of paths that met the lamp."""

import numpy as np
import pytest
from reference_drops import close_ups, glint_light, inside, without_glints


@pytest.fixture(scope="module")
def drops():
    return list(close_ups())


def test_the_wall_has_the_path_tracers_radiance_in_absolute_units(drops):
    for one in drops:
        assert one.ours_wall.mean() == pytest.approx(one.reference_wall.mean(), rel=0.005)


def test_the_picture_of_the_wall_in_a_drop_is_the_path_tracers(drops):
    for one in drops:
        theirs, ours = without_glints(one)
        assert ours.mean() == pytest.approx(theirs.mean(), rel=0.02), one.name
        if theirs.std() > 0.05:  # a drop close to the wall shows hardly anything but noise
            assert np.corrcoef(theirs, ours)[0, 1] >= 0.9, one.name


def test_the_total_light_of_drops_over_wall_is_the_path_tracers(drops):
    theirs = sum((one.reference / one.reference_wall)[inside(one)].mean() for one in drops)
    ours = sum((one.ours / one.ours_wall)[inside(one)].mean() for one in drops)
    assert ours / theirs == pytest.approx(1, abs=0.05)


def test_glints_are_where_the_path_tracer_has_them(drops):
    bright = [one for one in drops if glint_light(one.ours, one.ours_wall)[0] > 150]  # a dozen of its paths and more
    assert len(bright) >= 4
    for one in bright:
        theirs, ours = (
            glint_light(*pair)[1] for pair in ((one.reference, one.reference_wall), (one.ours, one.ours_wall))
        )
        assert np.linalg.norm(ours - theirs) < 0.1 * one.radius, one.name


def test_the_light_of_glints_is_the_path_tracers_within_its_counting_noise(drops):
    theirs = np.array([glint_light(one.reference, one.reference_wall)[0] * one.reference_wall.mean() for one in drops])
    ours = np.array([glint_light(one.ours, one.ours_wall)[0] * one.ours_wall.mean() for one in drops])
    assert ours.sum() / theirs.sum() == pytest.approx(1, abs=0.2)
    noise = np.sqrt(ours * [one.lamp_path_light for one in drops])
    assert np.sqrt(np.mean(((ours - theirs) / noise) ** 2)) < 1.7  # 1 but for chance: 12 drops
