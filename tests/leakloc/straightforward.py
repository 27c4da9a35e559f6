"""The paper's method as one would first write it: floats, loops, np.median. It defines what `leakloc` must return.

Loaded by path from the tests and from benchmarks/leakloc_paper.py. It shares no code with the package.
"""

from collections import Counter

import numpy as np


def background(frames):  # eq. 1
    return np.median(frames.astype(np.float64), axis=0)


def foreground(frames, background_grey):  # eq. 2
    return np.abs(frames.astype(np.float64) - background_grey)


def aggregate(foreground_grey):  # eq. 3
    return np.mean(foreground_grey, axis=(0, 1))


def detect(profile_grey, k_sigma, g_win_px):  # Algorithm 1
    width = len(profile_grey)
    if len(set(profile_grey.tolist())) == 1:
        return []  # nothing stands out, whatever the rounding of the mean says
    threshold = np.mean(profile_grey) + k_sigma * np.std(profile_grey)
    candidates = []
    for j in range(width):
        before = [profile_grey[i] for i in range(max(0, j - g_win_px), j)]
        after = [profile_grey[i] for i in range(j + 1, min(width, j + g_win_px + 1))]
        is_first_maximum = all(profile_grey[j] > g for g in before) and all(profile_grey[j] >= g for g in after)
        if profile_grey[j] > threshold and is_first_maximum:
            candidates.append(j)
    return candidates


def match(left_foreground, right_foreground, left_candidates, right_candidates):  # Algorithm 2
    swapped = len(left_candidates) > len(right_candidates)
    if swapped:
        left_foreground, right_foreground = right_foreground, left_foreground
        left_candidates, right_candidates = right_candidates, left_candidates
    remaining = list(right_candidates)
    pairs = []
    for c in left_candidates:
        votes = Counter()
        for left, right in zip(left_foreground, right_foreground, strict=True):
            distances = [np.linalg.norm(left[:, c] - right[:, other]) for other in remaining]
            votes[remaining[distances.index(min(distances))]] += 1
        most = max(votes.values())
        winner = min(column for column, count in votes.items() if count == most)
        remaining.remove(winner)
        pairs.append((winner, c) if swapped else (c, winner))
    return pairs


def triangulate(pairs, P1, P2, height_px):  # eq. 5-8
    places = []
    for columns in pairs:
        planes = [
            P.T @ np.cross([column, height_px, 1.0], [column, 0.0, 1.0])
            for column, P in zip(columns, (P1, P2), strict=True)
        ]
        A = np.array([[plane[0], plane[1]] for plane in planes])
        b = np.array([-plane[3] for plane in planes])
        try:
            places.append(np.linalg.solve(A, b))
        except np.linalg.LinAlgError:
            places.append(np.array([np.nan, np.nan]))
    return np.array(places).reshape(-1, 2)


def locate(left, right, P1, P2, k_sigma=2.0, g_win_px=10):
    """Everything in turn: foregrounds, profiles, candidates, pairs and places of both views."""
    foregrounds = [foreground(frames, background(frames)) for frames in (left, right)]
    profiles = [aggregate(moved) for moved in foregrounds]
    candidates = [detect(profile, k_sigma, g_win_px) for profile in profiles]
    pairs = match(*foregrounds, *candidates)
    return profiles, candidates, pairs, triangulate(pairs, P1, P2, left.shape[1])
