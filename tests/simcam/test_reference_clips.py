"""Streaks and shadows of path-traced clips, the same measure on both renderings."""

from collections import defaultdict

import numpy as np
import pytest
from reference_clips import compared, disc_light, pooled_light

import simcam.streaks
from simcam import render_clip
from simcam.dropview import no_glints

pytestmark = pytest.mark.xdist_group("reference clips")  # one worker: they are rendered once

FEW = 15  # streaks of one leak and view, below which their median is noise


@pytest.fixture(scope="module")
def differences():
    """Per kind and (view, leak): rows of simcam minus reference in column, first row, last row."""
    rows = defaultdict(list)
    for name in ("separated", "crowded"):
        for kind, view, leak, reference, ours in compared(name, render_clip):
            rows[kind, view, leak].append(
                (
                    ours.column_px - reference.column_px,
                    ours.first_row - reference.first_row,
                    ours.last_row - reference.last_row,
                )
            )
    return {key: np.array(values) for key, values in rows.items()}


def of_kind(differences, kind):
    return [rows for key, rows in differences.items() if key[0] == kind]


def test_drop_columns_are_the_path_tracers(differences):
    groups = of_kind(differences, "drop")
    assert max(abs(np.median(rows[:, 0])) for rows in groups if len(rows) >= FEW) < 0.2
    assert np.mean(np.abs(np.concatenate(groups)[:, 0]) < 0.5) >= 0.95


def test_shadow_columns_are_the_path_tracers(differences):
    groups = of_kind(differences, "shadow")
    assert max(abs(np.median(rows[:, 0])) for rows in groups if len(rows) >= FEW) < 0.15
    assert np.mean(np.abs(np.concatenate(groups)[:, 0]) < 1.0) >= 0.98


def test_streaks_begin_and_end_in_the_path_tracers_rows(differences):
    ends = np.concatenate(of_kind(differences, "drop"))[:, 1:]
    assert np.median(ends, axis=0).tolist() == [0, 0]
    assert (np.mean(np.abs(ends) <= 1, axis=0) >= 0.9).all()


def test_drops_mirror_the_wall_behind_the_cameras_and_shadows_are_as_deep_as_it_makes_them(monkeypatch):
    # That wall's rust is not given. Its bounced light fills the shadows, and drops reflect it: two measurements of one
    # number, the reflectance there over the mean of the wall that is seen.
    monkeypatch.setattr(simcam.streaks, "drop_glints", lambda _, nodes: no_glints(len(nodes.fall_s)))
    dark, light = (pooled_light("separated", render_clip, hidden) for hidden in (0.1, 1.0))
    reference_drop, reference_shadow = dark["drop"][:, 0].sum(), dark["shadow"][:, 0].sum()
    darkest, lightest = dark["drop"][:, 1].sum(), light["drop"][:, 1].sum()
    share = (reference_drop - darkest) / (lightest - darkest)
    assert 0 < share < 1  # a reflectance that rust can have
    shadow = (1 - share) * dark["shadow"][:, 1].sum() + share * light["shadow"][:, 1].sum()
    assert shadow / reference_shadow == pytest.approx(1, abs=0.1)
    # without that number (hidden = 1): the drops' light within 15 % of what they cover, the shadows within 10 %
    assert abs(light["drop"][:, 1].sum() - reference_drop) < 0.15 * disc_light("separated")
    assert light["shadow"][:, 1].sum() / reference_shadow == pytest.approx(1, abs=0.1)
