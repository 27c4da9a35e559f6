"""Why does it fail: the same scene, the same draws, with one cause removed at a time, and what each removal cures."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from html import escape

from leakloc import Estimate
from scenarios import figures
from scenarios.estimators import Broken, EstimatorSpec, run_estimator
from scenarios.leaks import resolved
from scenarios.outcome import Outcomes, outcomes
from scenarios.report import page
from scenarios.scenario import Scenario
from scenarios.score import Score, score
from scenarios.simulate import SimulatedClip, simulate

SHARPER = 20.0
"""Motion blur is removed by exposing this many times more briefly, in light and radiation as many times stronger."""


NOTHING = "(as it is)"


@dataclass(frozen=True)
class Cause:
    """Something that can make an estimator fail, and the scenario without it."""

    name: str
    without: Callable[[Scenario], Scenario]


@dataclass(frozen=True)
class Arm:
    """One run of the scene: what was removed (NOTHING first), and what came out."""

    removed: str
    clip: SimulatedClip
    estimate: Estimate | None
    scored: Score
    codes: Outcomes
    breakdown: str = ""
    detail: str = ""


def explain(scenario: Scenario, estimator: EstimatorSpec) -> Iterator[Arm]:
    """Yield the scene as it is and then without each cause that it has; leaks and drop times stay the same."""
    whole = resolved(scenario)
    yield _arm(NOTHING, whole, estimator)
    for cause in causes(whole):
        yield _arm(cause.name, cause.without(whole), estimator)


def causes(scenario: Scenario) -> list[Cause]:
    """Causes that a resolved scenario has, those left out that it has not."""
    known = [
        Cause("drop shadows", lambda s: _with(s, "effects", drop_shadows=False)),
        Cause("gamma", lambda s: _with(s, "gamma", dose_rate_gy_h=0.0)),
        Cause("sensor noise", lambda s: _with(_with(s, "effects", shot_noise=False), "sensor", read_noise_e=0.0)),
        Cause("structures", lambda s: s.model_copy(update={"structure": ()})),
        Cause("motion blur", _sharp),
        Cause("misalignment", _as_believed),
        *(Cause(f"leaks other than {i}", _only(i)) for i in range(len(scenario.leak)) if len(scenario.leak) > 1),
    ]
    return [cause for cause in known if cause.without(scenario) != scenario]


def cures(arms: list[Arm]) -> dict[int, list[str]]:
    """For every leak that the first arm does not find: the causes whose removal lets it be found."""
    first, *others = arms
    return {
        leak: [arm.removed for arm in others if arm.codes.leaks.get(_number_in(arm, leak)) == "found"]
        for leak, code in first.codes.leaks.items()
        if code != "found"
    }


def table(arms: list[Arm]) -> str:
    """Return a text table, an arm a row, with the code of every leak and the false estimates; then what cures what."""
    leaks = list(arms[0].codes.leaks)
    width = max(len(arm.removed) for arm in arms) + 2
    lines = ["without".ljust(width) + "".join(f"leak {leak}".ljust(22) for leak in leaks) + "false"]
    for arm in arms:
        cells = [arm.breakdown or arm.codes.leaks.get(_number_in(arm, leak), "-") for leak in leaks]
        false = arm.breakdown or ", ".join(sorted(arm.codes.estimates.values())) or "-"
        lines.append(arm.removed.ljust(width) + "".join(cell.ljust(22) for cell in cells) + false)
    lines.append("")
    cured = cures(arms)
    for leak, names in cured.items():
        lines.append(f"leak {leak} is found without: {', '.join(names) or 'none of these alone'}")
    found = [] if cured or arms[0].breakdown else ["every leak is found as it is"]
    return "\n".join([*lines, *found])


def explain_html(arms: list[Arm]) -> str:
    """Return one offline page: the table, and the top view and the residual of every arm side by side."""
    cards = "".join(_card(arm) for arm in arms)
    title = f"Why: {arms[0].clip.scenario.name or 'scenario'}"
    body = (
        f"<h1>{escape(title)}</h1><p class='quiet'>The same scene and draws, without one cause at a time.</p>"
        f"<pre>{escape(table(arms))}</pre><div class='pair'>{cards}</div>"
    )
    return page(title, [body])


def _card(arm: Arm) -> str:
    estimates = [(leak.x_m, leak.y_m) for leak in arm.estimate.leaks] if arm.estimate else []
    picture = figures.residual_png(arm.clip.left)
    return (
        f"<figure><h2>{escape(_headline(arm))}</h2>{figures.top_view(arm.clip.truth, estimates, arm.scored)}"
        f"<img src='{picture}' alt='residual'><figcaption>left, mean |I - median| over the frames</figcaption></figure>"
    )


def _headline(arm: Arm) -> str:
    return "as it is" if arm.removed == NOTHING else f"without {arm.removed}"


def _arm(removed: str, scenario: Scenario, estimator: EstimatorSpec) -> Arm:
    clip = simulate(scenario)
    answer = run_estimator(estimator, clip)
    if isinstance(answer, Broken):
        nothing = score([], clip.truth)
        lost = Outcomes(dict.fromkeys((leak.id for leak in clip.truth.leaks), answer.code), {})
        return Arm(removed, clip, None, nothing, lost, answer.code, answer.detail)
    scored = score([(leak.x_m, leak.y_m) for leak in answer.leaks], clip.truth)
    return Arm(removed, clip, answer, scored, outcomes(answer, clip.truth, clip.believed_rig, scored))


def _number_in(arm: Arm, leak: int) -> int:
    """Number of a leak of the whole scene in an arm: an arm with one leak left calls it 0."""
    alone = arm.removed.removeprefix("leaks other than ")
    if alone == arm.removed:
        return leak
    return 0 if int(alone) == leak else -1


def _with(scenario: Scenario, table: str, **values: object) -> Scenario:
    return scenario.model_copy(update={table: getattr(scenario, table).model_copy(update=values)})


def _sharp(scenario: Scenario) -> Scenario:
    lamps = tuple(lamp.model_copy(update={"power_w": SHARPER * lamp.power_w}) for lamp in scenario.lamp)
    brief = _with(scenario, "recording", exposure_s=scenario.recording.exposure_s / SHARPER)
    strong = _with(brief, "gamma", dose_rate_gy_h=SHARPER * scenario.gamma.dose_rate_gy_h)
    return strong.model_copy(update={"lamp": lamps})


def _as_believed(scenario: Scenario) -> Scenario:
    told, rig = scenario.believed_rig, scenario.rig
    true = {
        "roll_deg": told.roll_deg,
        "pitch_deg": told.pitch_deg,
        "yaw_deg": told.yaw_deg,
        "right_roll_deg": 0.0,
        "right_pitch_deg": 0.0,
        "right_yaw_deg": 0.0,
        "baseline_m": rig.baseline_m if told.baseline_m is None else told.baseline_m,
        "hfov_deg": rig.hfov_deg if told.hfov_deg is None else told.hfov_deg,
    }
    return _with(scenario, "rig", **true)


def _only(number: int) -> Callable[[Scenario], Scenario]:
    return lambda scenario: scenario.model_copy(update={"leak": (scenario.leak[number],)})
