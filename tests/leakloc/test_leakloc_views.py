from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from leakloc import Estimate, LeakEstimate, locate, write_result
from leakloc.views import FLOOR_M, GATE_CHI2, GATE_M, fuse_views, panned

NAN = float("nan")


def leak(x_m, y_m, sigma_m=0.03, score=5.0, columns_px=(500.0, 400.0)):
    covariance = np.full((2, 2), NAN) if sigma_m is None else np.eye(2) * sigma_m**2
    return LeakEstimate(x_m, y_m, covariance, score, *columns_px, 0.1)


def view(*leaks, method="robust", frame="world"):
    return Estimate(method, frame, leaks, {"note": len(leaks)})


def summary(estimate):
    return [(k.x_m, k.y_m, k.covariance_m2.tolist(), k.score, k.left_column_px) for k in estimate.leaks]


@st.composite
def views(draw):
    """Up to four views of a few places, each missing some, with some invented, with and without covariances."""
    near = st.floats(-0.2, 0.2)
    places = draw(st.lists(st.tuples(st.floats(0, 2), st.floats(-2, 2)), min_size=1, max_size=4))
    made = []
    for _ in range(draw(st.integers(2, 4))):
        leaks = [
            leak(
                x + draw(near) / 3,
                y + draw(near) / 3,
                draw(st.sampled_from([None, 0.01, 0.03, 0.1])),
                draw(st.floats(1, 9)),
            )
            for x, y in places
            if draw(st.booleans())
        ]
        made.append(view(*leaks))
    return made


@given(views(), st.randoms(use_true_random=False))
def test_the_order_of_the_views_does_not_matter(estimates, random):
    places = [(k.x_m, k.y_m) for estimate in estimates for k in estimate.leaks]
    assume(len(set(places)) == len(places))
    gaps = [np.hypot(a[0] - b[0], a[1] - b[1]) for a, b in combinations(places, 2)]
    assume(len({round(gap, 9) for gap in gaps}) == len(gaps))  # of two pairs equally far apart either may merge first
    shuffled = list(estimates)
    random.shuffle(shuffled)
    np.testing.assert_equal(summary(fuse_views(estimates)), summary(fuse_views(shuffled)))


def test_sums_and_ties_do_not_depend_on_the_order_to_the_last_bit():
    alike = [view(leak(1 + x, 0.1 * x, sigma, 5.0, (500 + x, 400))) for x, sigma in ((0.001, 0.03), (0.013, 0.03))]
    others = [view(leak(1.007, 0.003, 0.07)), view(leak(1.002, -0.011, 0.09))]
    fused = [summary(fuse_views(order)) for order in permutations(alike + others)]
    assert all(one == fused[0] for one in fused)


@given(views())
def test_every_sighting_is_in_one_leak_and_two_of_a_view_are_in_two(estimates):
    fused = fuse_views(estimates).diagnostics["fused"]
    for described in fused:
        assert len(set(described["views"])) == len(described["views"])
        assert described["best"] in described["views"]
        assert (len(described["views"]) == 1) == np.isnan(described["disagreement"])
        assert not described["disagreement"] > 1
    for number, estimate in enumerate(estimates):
        assert sum(number in described["views"] for described in fused) == len(estimate.leaks)


@st.composite
def covariances(draw):
    angle, axes_m = draw(st.floats(0, np.pi)), [draw(st.floats(0.001, 0.3)) for _ in range(2)]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return turn @ np.diag(np.square(axes_m)) @ turn.T


@given(covariances(), covariances(), st.floats(-0.02, 0.02))
def test_a_leak_seen_in_two_views_has_a_smaller_covariance_in_every_direction(first, second, apart_m):
    seen = [view(LeakEstimate(x, 0.0, c, 1.0, 1, 2, NAN)) for x, c in ((1.0, first), (1.0 + apart_m, second))]
    (one,) = fuse_views(seen).leaks
    for own in (first, second):
        assert (np.linalg.eigvalsh(own - one.covariance_m2) > 0).all()


def test_one_view_is_itself():
    estimate = view(leak(1, 0), leak(1.001, 0))
    assert fuse_views([estimate]) is estimate


def test_two_views_of_one_leak_by_hand():
    # variances 1 and 3 (cm2): weights 3/4 and 1/4, merged variance 3/4
    fused = fuse_views(
        [view(leak(1.00, 0.5, 0.01, 4.0, (500, 400))), view(leak(1.04, 0.5, 0.01 * 3**0.5, 7.0, (90, 20)))]
    )
    (one,) = fused.leaks
    assert (one.x_m, one.y_m) == pytest.approx((1.01, 0.5))
    np.testing.assert_allclose(one.covariance_m2, np.eye(2) * 0.75e-4)
    assert (one.score, one.left_column_px, one.right_column_px) == (7.0, 500, 400)  # columns of the surer view
    (described,) = fused.diagnostics["fused"]
    assert (described["views"], described["best"]) == ([0, 1], 0)
    assert described["disagreement"] == pytest.approx(0.04 / np.sqrt(GATE_CHI2 * (4e-4 + FLOOR_M**2)))
    assert fused.diagnostics["views"] == [{"note": 1}, {"note": 1}]
    assert (fused.method, fused.frame) == ("robust", "world")


def test_the_weights_are_matrices_a_long_ellipse_counts_across_itself_alone():
    long_in_x = LeakEstimate(1.0, 0.0, np.diag([1.0, 1e-6]), 5.0, 1, 2, NAN)
    long_in_y = LeakEstimate(1.3, 0.4, np.diag([1e-6, 1.0]), 5.0, 1, 2, NAN)
    (one,) = fuse_views([view(long_in_x), view(long_in_y)]).leaks
    assert (one.x_m, one.y_m) == pytest.approx((1.3, 0.0), abs=1e-5)
    assert np.diag(one.covariance_m2) == pytest.approx([1e-6, 1e-6], rel=1e-5)


@pytest.mark.parametrize("sigma_m", [None, 0.001, 0.05])
def test_the_gate_is_where_it_is_stated(sigma_m):
    gate_m = GATE_M if sigma_m is None else np.sqrt(GATE_CHI2 * (2 * sigma_m**2 + FLOOR_M**2))
    for factor, count in ((0.999, 1), (1.001, 2)):
        fused = fuse_views([view(leak(1, 0, sigma_m)), view(leak(1 + factor * gate_m, 0, sigma_m))])
        assert len(fused.leaks) == count


def test_without_covariances_places_are_averaged_and_a_known_covariance_rules():
    (mean,) = fuse_views([view(leak(1.0, 0, None)), view(leak(1.1, 0, None)), view(leak(1.2, 0, None))]).leaks
    assert mean.x_m == pytest.approx(1.1)
    assert np.isnan(mean.covariance_m2).all()
    (ruled,) = fuse_views([view(leak(1.0, 0, None)), view(leak(1.1, 0, 0.03))]).leaks
    assert ruled.x_m == pytest.approx(1.1)
    np.testing.assert_allclose(ruled.covariance_m2, np.eye(2) * 9e-4)


def test_a_chain_of_views_does_not_merge_what_its_ends_deny():
    ends_apart = [view(leak(x, 0, None)) for x in (0.0, 0.25, 0.5)]
    assert len(fuse_views(ends_apart).leaks) == 2


def test_crowded_leaks_pair_off_with_their_own():
    first, second = view(leak(1, 0.0), leak(1, 0.05)), view(leak(1, 0.051), leak(1, 0.001))
    for pair in permutations((first, second)):
        fused = fuse_views(pair)
        assert sorted(k.y_m for k in fused.leaks) == pytest.approx([0.0005, 0.0505])


def test_a_leak_outside_one_view_is_kept_from_the_other_with_its_provenance():
    fused = fuse_views([view(leak(1, 0, score=3.0)), view(), view(leak(1, 0, score=4.0), leak(0, 2, score=9.0))])
    assert [d["views"] for d in fused.diagnostics["fused"]] == [[2], [0, 2]]
    assert fused.leaks[0].score == 9.0


def test_views_without_leaks_fuse_to_none_and_the_result_can_be_written(tmp_path):
    assert fuse_views([view(), view()]).leaks == ()
    write_result(fuse_views([view(leak(1, 0)), view(leak(1, 0, None), leak(0, 1))]), tmp_path / "result.json")


@pytest.mark.parametrize(
    ("estimates", "said"),
    [
        ([], "at least one estimate"),
        ([view(), view(frame="left camera")], "one frame, got left camera, world"),
        ([view(), view(method="paper")], "one method, got paper, robust"),
    ],
)
def test_views_that_do_not_belong_together_are_refused(estimates, said):
    with pytest.raises(ValueError, match=said):
        fuse_views(estimates)


def test_the_papers_rig_turned_left_by_90_deg_looks_along_y_from_the_same_place(make_rig):
    turned = panned(make_rig(), 90)
    # the baseline's middle (-2.4, 0, 0) stays; the left camera was at y = +0.25 and is now 0.25 m behind in x
    np.testing.assert_allclose(turned.frame_from_left @ [0, 0, 0, 1], [-2.65, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(turned.right_from_frame @ [-2.15, 0, 0, 1], [0, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(turned.frame_from_left @ [0, 0, 1, 0], [0, 1, 0, 0], atol=1e-12)  # forward: +y
    np.testing.assert_allclose(turned.frame_from_left @ [0, 1, 0, 0], [0, 0, -1, 0], atol=1e-12)  # still level


def test_a_rig_without_a_pose_turns_in_the_level_frame_of_its_first_view(make_rig):
    rig = make_rig(world_from_left=None)
    turned = panned(rig, 30)
    # from the left camera, the middle of the baseline is 0.25 m to its right: (0, -0.25)
    middle, left = np.array([0, -0.25]), (turned.frame_from_left @ [0, 0, 0, 1])[:2]
    assert left - middle == pytest.approx([-0.25 * np.sin(np.radians(30)), 0.25 * np.cos(np.radians(30))])
    np.testing.assert_allclose(panned(rig, 0).frame_from_left, rig.frame_from_left, atol=1e-15)
    assert panned(rig, 0).frame == turned.frame == "world"


@given(st.floats(-180, 180), st.floats(-180, 180), st.booleans())
def test_two_turns_are_one_and_the_middle_of_the_baseline_stays(make_rig, first_deg, second_deg, posed):
    rig = make_rig() if posed else make_rig(world_from_left=None)
    once, twice = panned(rig, first_deg + second_deg), panned(panned(rig, first_deg), second_deg)
    np.testing.assert_allclose(once.frame_from_left, twice.frame_from_left, atol=1e-12)
    for turned in (rig, once):
        left = turned.frame_from_left[:3, 3]
        right = np.linalg.inv(turned.right_from_frame)[:3, 3]
        np.testing.assert_allclose((left + right) / 2, [-2.4, 0, 0] if posed else [0, -0.25, 0], atol=1e-12)


def test_an_angle_that_is_none_is_refused(make_rig):
    with pytest.raises(ValueError, match="pan_deg must be finite, got nan"):
        panned(make_rig(), NAN)


def test_one_leak_seen_by_the_paper_s_method_from_two_pan_angles_is_one_leak_at_its_place(make_rig, make_dripping):
    place = np.array([0.3, 0.1, 0, 1])
    estimates = []
    for pan_deg in (-10, 12):
        rig = panned(make_rig(480, 40), pan_deg)
        columns = [round((P @ place)[0] / (P @ place)[2]) for P in (rig.P1, rig.P2)]
        clip = [make_dripping([column], width_px=480) for column in columns]
        estimates.append(locate(*clip, rig, method="paper"))
    (one,) = fuse_views(estimates).leaks
    assert np.hypot(one.x_m - place[0], one.y_m - place[1]) < 0.06  # whole columns: 43 mm a pixel
