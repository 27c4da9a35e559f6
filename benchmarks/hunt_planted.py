"""How soon a hunt meets ten planted failures, beside plain random sampling of the same space.

Part 1, over seeds, with stand-ins that do not render: scenes until the failure is met, and how many of the ten within
the budget. Part 2 (--real), rendered, once per failure on 2 workers: scenes and seconds until it is met, what it is
shrunk to, and whether the file replays; random sampling is rendered for the seconds of one hunt.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "scenarios")]

from planted_failures import PLANTED, is_met, situation_of, space, stand_in  # noqa: E402

from scenarios.draws import seed_of_clip  # noqa: E402
from scenarios.estimators import EstimatorSpec  # noqa: E402
from scenarios.hunt import Quarry, hunt, on_lanes  # noqa: E402
from scenarios.lanes import lanes_of  # noqa: E402
from scenarios.run_campaign import local_workers  # noqa: E402
from scenarios.scenario_file import read_scenario  # noqa: E402
from scenarios.scene_file import conditions  # noqa: E402
from scenarios.scene_work import SceneWork  # noqa: E402
from scenarios.shrink import codes_of, shrink  # noqa: E402
from scenarios.shrunk_folder import told  # noqa: E402
from scenarios.space_point import n_shares, scenario_of  # noqa: E402

NEVER = 10**6
CODE = "missed.unexplained"
MOST_FIELDS = 3
RANDOM_SCENES, BATCH = 4000, 48


def hunted_without_rendering(planted, seed, budget):
    def evaluate(works):
        return [stand_in(planted, work.scenario) for work in works]

    quarry = Quarry(space(), EstimatorSpec("method", "robust"), seed)
    for tried in hunt(quarry, evaluate, budget):
        for one in tried:
            if is_met(planted, one.scenario, one.run):
                return one.number + 1
    return NEVER


def random_scenes(seed, budget):
    where, rng = space(), np.random.default_rng(seed)
    scenes = (scenario_of(where, rng.random(n_shares(where)), seed_of_clip(seed, i)) for i in range(10 * budget))
    return [scene for scene in scenes if scene is not None][:budget]


def random_without_rendering(planted, scenes):
    met = (i for i, scene in enumerate(scenes, 1) if is_met(planted, scene, stand_in(planted, scene)))
    return next(met, NEVER)


def over_seeds(n_seeds, budget):
    print(f"scenes until met, median over {n_seeds} seeds, and seeds that met it within {budget} scenes; not rendered")
    print(f"{'planted':<58} {'share':>6} {'hunt':>14} {'random':>14}")
    totals = np.zeros((2, n_seeds), dtype=int)
    samples = [random_scenes(10_000 + seed, budget) for seed in range(n_seeds)]
    for planted in PLANTED:
        counts = np.array(
            [
                [hunted_without_rendering(planted, seed, budget) for seed in range(n_seeds)],
                [random_without_rendering(planted, scenes) for scenes in samples],
            ]
        )
        totals += counts <= budget
        medians = [_scenes(np.quantile(row, 0.5, method="higher")) for row in counts]
        cells = [f"{m:>7} {np.sum(row <= budget):>3}/{n_seeds}" for m, row in zip(medians, counts, strict=True)]
        print(f"{planted.words:<58} {planted.share:6.1%} {cells[0]:>14} {cells[1]:>14}", flush=True)
    for name, row in zip(("hunt", "random"), totals, strict=True):
        print(f"{name}: of ten, {row.mean():.1f} on average, {row.min()} to {row.max()} over seeds")


def _scenes(count):
    return "-" if count >= NEVER else f"{count:.0f}"


def rendered(budget_s, n_workers, seed):
    """Hunt each failure until it is met; returns how many were met, shrunk to three fields at most, and replayed."""
    print(f"rendered, the robust method made blind, {n_workers} workers, at most {budget_s:g} s each, seed {seed}")
    print(f"{'planted':<58} {'scenes':>7} {'s':>5} {'fields':>6} {'replays':>7}  shrunk to")
    shown, needed, total_s = [], [], 0.0
    with lanes_of(local_workers(n_workers)) as lanes:
        for number, planted in enumerate(PLANTED):
            spec = EstimatorSpec("callable", f"planted_failures:planted_{number}")
            found, n_scenes, took_s = _hunted(Quarry(space(), spec, seed), planted, lanes, budget_s)
            total_s += took_s
            needed.append(n_scenes)
            if found is None:
                print(f"{planted.words:<58} {f'> {n_scenes}':>7} {took_s:5.0f}", flush=True)
                continue
            *_, plain = shrink(found.scenario, CODE, codes_of(spec), _leak_met(planted, found))
            fields = conditions(plain.scenario)
            shown.append((len(fields) <= MOST_FIELDS, _replays(plain.scenario, spec)))
            cells = f"{n_scenes:>7} {took_s:5.0f} {len(fields):>6} {'yes' if shown[-1][1] else 'NO':>7}"
            print(f"{planted.words:<58} {cells}  {', '.join(fields) or '(plain)'}", flush=True)
        print(f"hunt: {len(shown)} of {len(PLANTED)} met, {sum(needed) / total_s:.2f} scenes a second", flush=True)
        until, n_random = _rendered_at_random(lanes, budget_s, seed)
        met = sum(one < NEVER for one in until)
        sooner = sum(one <= other for one, other in zip(until, needed, strict=True))
        print(f"random: {met} met, after {list(map(_scenes, until))}, in the {n_random} scenes of {budget_s:g} s;")
        print(f"{sooner} within the scenes that the hunt took", flush=True)
    return len(shown), sum(few for few, _ in shown), sum(same for _, same in shown)


def _leak_met(planted, found):
    scene = found.scenario
    missed = [leak.leak for leak in found.run.leaks if leak.observable and leak.code != "found"]
    return next(i for i in missed if planted.is_blind(situation_of(scene, scene.leak[i].x_m, scene.leak[i].y_m)))


def _hunted(quarry, planted, lanes, budget_s):
    """Return the first scene that meets a planted failure (None without), how many it took, and seconds."""
    start_s = time.monotonic()
    for tried in hunt(quarry, on_lanes(lanes)):
        took_s = time.monotonic() - start_s
        met = next((one for one in tried if is_met(planted, one.scenario, one.run)), None)
        if met is not None:
            return met, met.number + 1, took_s
        if took_s > budget_s:
            return None, tried[-1].number + 1, took_s
    raise AssertionError("unreachable: hunts have no end")


def _rendered_at_random(lanes, budget_s, seed):
    """Scenes of a random sample until each failure is met (an observable leak stands in its range), and how many."""
    spec = EstimatorSpec("callable", "planted_failures:planted_0")  # any of the ten: the truth is looked at
    until, number = [NEVER] * len(PLANTED), 0
    scenes = random_scenes(10_000 + seed, RANDOM_SCENES)
    start_s = time.monotonic()
    while time.monotonic() - start_s < budget_s:
        works = [SceneWork(number + i, one, (spec,), 300.0) for i, one in enumerate(scenes[number : number + BATCH])]
        number += len(works)
        for outcome in lanes.done([[work] for work in works]):
            scene = scenes[outcome.number]
            for i, planted in enumerate(PLANTED):
                places = [(leak.x_m, leak.y_m) for leak in outcome.runs[0].leaks if leak.observable]
                if any(planted.is_blind(situation_of(scene, *place)) for place in places):
                    until[i] = min(until[i], outcome.number + 1)
    return until, number


def _replays(scenario, spec):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(told(scenario, CODE, spec))
        return CODE in codes_of(spec)(read_scenario(path)) and len(path.read_text().splitlines()) <= 20


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", type=int, default=6)
    options.add_argument("--scenes", type=int, default=900)
    options.add_argument("--real", action="store_true")
    options.add_argument("--budget-s", type=float, default=300.0)
    options.add_argument("--workers", type=int, default=2)
    options.add_argument("--seed", type=int, default=0)
    given = options.parse_args()
    cv2.setNumThreads(1)
    if given.real:
        rendered(given.budget_s, given.workers, given.seed)
    else:
        over_seeds(given.seeds, given.scenes)


if __name__ == "__main__":
    main()
