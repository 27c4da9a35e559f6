"""How soon a hunt meets ten planted failures, beside plain random sampling of the same space.

Until a hunt meets its failure it goes as if there were none, so one hunt of a method that is nowhere blind tells for
all ten when they would be met: when an observable leak first stands in their range. Part 1, over seeds, with stand-ins
that do not render. Part 2 (--rendered), the same with the robust method on 2 workers, hunts and random samples of so
many seconds each. Part 3 (--each): ten hunts of the robust method made blind, each until it meets its failure; what is
met is shrunk and replayed from its file.
"""

import argparse
import sys
import tempfile
import time
from itertools import count
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "scenarios")]

from planted_failures import NOWHERE, PLANTED, is_met, situation_of, space, stand_in, stands_in  # noqa: E402

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
BATCH = 12  # as many as a hunt's round
ROBUST = EstimatorSpec("method", "robust")
WORDS = max(len(planted.words) for planted in PLANTED) + 1


def hunted_rounds(evaluate, seed):
    """Yield rounds of (scenario, run) of a hunt without end."""
    for tried in hunt(Quarry(space(), ROBUST, seed), evaluate):
        yield [(one.scenario, one.run) for one in tried]


def random_rounds(evaluate, seed):
    """Yield rounds of (scenario, run) of a random sample without end."""
    where, rng, number = space(), np.random.default_rng(10_000 + seed), count()
    while True:
        drawn = (scenario_of(where, rng.random(n_shares(where)), seed_of_clip(seed, next(number))) for _ in count())
        valid = (scene for scene in drawn if scene is not None)
        works = [SceneWork(i, scene, (ROBUST,), 300.0) for i, scene in zip(range(BATCH), valid, strict=False)]
        yield [(work.scenario, run) for work, run in zip(works, evaluate(works), strict=True)]


def first_met(rounds, is_over):
    """Return the scenes until each of the ten is met, and how many there were until `is_over` said so of their number.

    A round that ends after the end does not count.
    """
    until, number = [NEVER] * len(PLANTED), 0
    for scenes in rounds:
        if is_over(number + len(scenes)):
            return until, number
        for scene, run in scenes:
            number += 1
            for i, planted in enumerate(PLANTED):
                if until[i] == NEVER and stands_in(planted, scene, run):
                    until[i] = number
    raise AssertionError("unreachable: rounds have no end")


def over_seeds(n_seeds, budget):
    print(f"scenes until met, median over {n_seeds} seeds, and seeds that met it within {budget} scenes; not rendered")

    def evaluate(works):
        return [stand_in(NOWHERE, work.scenario) for work in works]

    both = [
        [first_met(rounds(evaluate, seed), lambda n: n > budget)[0] for seed in range(n_seeds)]
        for rounds in (hunted_rounds, random_rounds)
    ]
    print_table(np.array(both))


def over_rendered_seeds(seeds, budget_s, n_workers):
    print(f"rendered, the robust method, {n_workers} workers, {budget_s:g} s a hunt and as many a random sample")
    both = [[], []]
    for seed in seeds:
        for of_kind, rounds, kind in zip(both, (hunted_rounds, random_rounds), ("hunt", "random"), strict=True):
            with lanes_of(local_workers(n_workers)) as lanes:  # each begins with workers that know nothing
                until, n_scenes = first_met(rounds(on_lanes(lanes), seed), _over_after(budget_s))
            of_kind.append(until)
            met = sum(one < NEVER for one in until)
            print(f"seed {seed}, {kind}: {met} met in {n_scenes} scenes: {list(map(_scenes, until))}", flush=True)
    print_table(np.array(both))


def _over_after(budget_s):
    end_s = time.monotonic() + budget_s
    return lambda _: time.monotonic() > end_s


def print_table(both):
    """Print scenes until met, (hunt and random, seeds, ten)."""
    n_seeds = both.shape[1]
    print(f"{'planted':<{WORDS}} {'share':>6} {'hunt':>14} {'random':>14}")
    for i, planted in enumerate(PLANTED):
        medians = [_scenes(np.quantile(row, 0.5, method="higher")) for row in both[:, :, i]]
        met = [np.sum(row < NEVER) for row in both[:, :, i]]
        cells = [f"{median:>7} {n:>3}/{n_seeds}" for median, n in zip(medians, met, strict=True)]
        print(f"{planted.words:<{WORDS}} {planted.share:6.1%} {cells[0]:>14} {cells[1]:>14}")
    for name, of_seeds in zip(("hunt", "random"), (both < NEVER).sum(axis=2), strict=True):
        print(f"{name}: of ten, {of_seeds.mean():.1f} on average, {of_seeds.min()} to {of_seeds.max()} over seeds")


def _scenes(count):
    return "-" if count >= NEVER else f"{count:.0f}"


def each(budget_s, n_workers, seed):
    """Hunt each failure until it is met; returns how many were met, shrunk to three fields at most, and replayed."""
    print(f"rendered, the robust method made blind, {n_workers} workers, at most {budget_s:g} s each, seed {seed}")
    print(f"{'planted':<{WORDS}} {'scenes':>7} {'s':>5} {'fields':>6} {'replays':>7}  shrunk to")
    shown = []
    with lanes_of(local_workers(n_workers)) as lanes:
        for number, planted in enumerate(PLANTED):
            spec = EstimatorSpec("callable", f"planted_failures:planted_{number}")
            found, n_scenes, took_s = _hunted(Quarry(space(), spec, seed), planted, lanes, budget_s)
            if found is None:
                print(f"{planted.words:<{WORDS}} {f'> {n_scenes}':>7} {took_s:5.0f}", flush=True)
                continue
            *_, plain = shrink(found.scenario, CODE, codes_of(spec), _leak_met(planted, found))
            fields = conditions(plain.scenario)
            shown.append((len(fields) <= MOST_FIELDS, _replays(plain.scenario, spec)))
            cells = f"{n_scenes:>7} {took_s:5.0f} {len(fields):>6} {'yes' if shown[-1][1] else 'NO':>7}"
            print(f"{planted.words:<{WORDS}} {cells}  {', '.join(fields) or '(plain)'}", flush=True)
    few, same = sum(few for few, _ in shown), sum(same for _, same in shown)
    print(f"of ten, {len(shown)} met, {few} of them shrunk to at most {MOST_FIELDS} fields, {same} replayed")
    return len(shown), few, same


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
        if took_s > budget_s or met is not None:
            return met if took_s <= budget_s else None, (met or tried[-1]).number + 1, took_s
    raise AssertionError("unreachable: hunts have no end")


def _replays(scenario, spec):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(told(scenario, CODE, spec))
        return CODE in codes_of(spec)(read_scenario(path)) and len(path.read_text().splitlines()) <= 20


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", type=int, default=6, help="so many, from --seed on")
    options.add_argument("--scenes", type=int, default=900, help="of part 1")
    options.add_argument("--rendered", action="store_true")
    options.add_argument("--each", action="store_true", help="with --seed alone")
    options.add_argument("--budget-s", type=float, default=300.0)
    options.add_argument("--workers", type=int, default=2)
    options.add_argument("--seed", type=int, default=0)
    given = options.parse_args()
    cv2.setNumThreads(1)
    if given.each:
        each(given.budget_s, given.workers, given.seed)
    elif given.rendered:
        over_rendered_seeds(range(given.seed, given.seed + given.seeds), given.budget_s, given.workers)
    else:
        over_seeds(given.seeds, given.scenes)


if __name__ == "__main__":
    main()
