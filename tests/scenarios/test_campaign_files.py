"""Campaign files: every mistake at once, in the file and in its arms; the same seeds in every arm."""

import json
import os
from pathlib import Path

import pytest
import trimesh
from click.testing import CliRunner

from scenarios.arms import arms_of
from scenarios.campaign import Campaign
from scenarios.campaign_file import CAMPAIGNS, CampaignError, CampaignFile, read_campaign, repeated
from scenarios.cli import main
from scenarios.draws import seed_of_clip
from scenarios.estimators import EstimatorSpec
from scenarios.evaluation import EXPERIMENTS
from scenarios.leaks import resolved
from scenarios.run_campaign import Study
from scenarios.scenario_file import read_scenario

BASE = 'scenario = "separated"\n'
AXIS = '[[axis]]\nkey = "gamma.dose_rate_gy_h"\nvalues = [0.0, 10.0]\n'
CHOICE = '[[choice]]\nname = "lamps"\n[[choice.variant]]\nname = "one"\n'

BASELINES = '[[axis]]\nkey = "rig.baseline_m"\n'
TURNS = "".join(f'[[axis]]\nkey = "rig.{turn}_deg"\nvalues = {list(range(30))}\n' for turn in ("roll", "yaw"))

# what is wrong, the text, and words that the one line must hold
BAD = [
    ("syntax", "[axis\n", ("not valid TOML", "line 1")),
    ("nothing to sweep", "repeats = 3\n", ("scenario", "required")),
    ("unknown base", 'scenario = "seperated"\n', ("scenario", 'did you mean "separated"')),
    ("unknown key", f"{BASE}repeat = 3\n", ("repeat", 'did you mean "repeats"', "3")),
    ("unknown key of an axis", f"{BASE}{AXIS}unit = 'm'\n", ("axis.0.unit", "not a known key")),
    ("foreign method", f'{BASE}methods = ["magic"]\n', ("methods.0", "'paper', 'robust' or 'naive'", "'magic'")),
    ("method twice", f'{BASE}methods = ["paper", "paper"]\n', ("methods", "twice", "'paper'")),
    ("axis twice", f"{BASE}{AXIS}{AXIS}", ("axis", "twice", "gamma.dose_rate_gy_h")),
    ("value twice", f"{BASE}{BASELINES}values = [0.5, 0.5]\n", ("axis.0.values", "twice", "0.5")),
    ("no values", f"{BASE}{BASELINES}values = []\n", ("axis.0.values", "at least one")),
    ("list for a value", f'{BASE}[[axis]]\nkey = "seed"\nvalues = [[1]]\n', ("axis.0.values.0", "a number, a text")),
    ("seed swept", f'{BASE}[[axis]]\nkey = "seed"\nvalues = [1]\n', ("axis.0.key", "must not set the seed")),
    ("seed set", f'{BASE}set = ["seed=1"]\n', ("set", "must not set the seed", "seed=1")),
    ("too many repeats", f"{BASE}repeats = 200000\n", ("repeats", "<= 100000", "200000")),
    ("too many runs", f'{BASE}repeats = 60000\nmethods = ["paper", "robust"]\n', ("repeats", "at most 100000 runs")),
    ("space and sweep", f'{BASE}[space]\nstratum = "easy"\nscenes = 3\n', ("scenario", "beside [space]")),
    ("unknown stratum", '[space]\nstratum = "mild"\nscenes = 3\n', ("space.stratum", "'easy', 'nominal' or 'hard'")),
    ("bad override", f'{BASE}set = ["rig.widht_px=3"]\n', ("set", "rig.widht_px", 'did you mean "width_px"')),
    ("bad value", f"{BASE}{BASELINES}values = [0.5, 11.0]\n", ("axis.0.values.1", "<= 10", "11.0")),
    ("bad variant", f'{BASE}{CHOICE}set = ["lamp.7.power_w=1.0"]\n', ("choice.0.variant.0", "index below 1")),
    ("too many arms", f"{BASE}{TURNS}", ("axis", "at most 500", "900")),
]


@pytest.mark.parametrize(("text", "words"), [pytest.param(t, w, id=i) for i, t, w in BAD])
def test_a_bad_campaign_gives_one_line_with_file_key_value_and_rule(tmp_path, text, words):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    result = CliRunner().invoke(main, ["campaign", "run", str(path), "-o", str(tmp_path / "results.db")])
    assert result.exit_code == 2
    (line,) = result.output.splitlines()
    assert line.startswith(f"Error: {path}: ")
    for word in words:
        assert word in line
    assert list(tmp_path.iterdir()) == [path]


def test_all_mistakes_are_reported_at_once_those_of_the_arms_included(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(f"""{BASE}repeat = 3
methods = ["magic"]
set = ["rig.widht_px=3"]
[[axis]]
key = "recording.fps"
values = [12.0, 24.0]
[[axis]]
key = "recording.exposure_s"
values = [0.05, 0.01, -1.0]
[[choice]]
name = 5
""")
    with pytest.raises(CampaignError) as caught:
        read_campaign(path)
    keys = [line.removeprefix(f"{path}: ").split(":")[0].split(" is")[0] for line in str(caught.value).splitlines()]
    assert sorted(keys) == [
        "axis.0.values.1 with axis.1.values.0",  # 0.05 s does not fit into 1 / 24 s, and does into 1 / 12 s
        "axis.1.values.2",
        "choice.0.name must be a text in quotes, got 5",
        "choice.0.variant",
        "methods.0 must be 'paper', 'robust' or 'naive', got 'magic'",
        "repeat",
        "set",
    ]


def campaign(text):
    return Campaign.model_validate(CAMPAIGNS.parsed(text, "x"))


def test_axes_are_crossed_the_last_fastest():
    arms = arms_of(campaign(f'{BASE}{AXIS}[[axis]]\nkey = "rig.baseline_m"\nvalues = [0.3, 0.5]\n'))
    assert [tuple(arm.values.values()) for arm in arms] == [(0.0, 0.3), (0.0, 0.5), (10.0, 0.3), (10.0, 0.5)]
    assert arms[2].overrides == ("gamma.dose_rate_gy_h=10.0", "rig.baseline_m=0.3")


def test_a_repeat_has_the_same_seed_leaks_and_drops_in_every_arm(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text(f"seed = 5\nrepeats = 3\n{BASE}{AXIS}")
    scenes = read_campaign(path).scenes()
    assert [scene.seed for scene in scenes] == [seed_of_clip(5, repeat) for repeat in (0, 1, 2, 0, 1, 2)]
    assert [resolved(scene.scenario).leak for scene in scenes[:3]] == [resolved(s.scenario).leak for s in scenes[3:]]
    assert len({resolved(scene.scenario).leak for scene in scenes}) == 3
    assert [scene.scenario.gamma.dose_rate_gy_h for scene in scenes] == [0.0, 0.0, 0.0, 10.0, 10.0, 10.0]


def test_a_scene_is_made_again_from_its_name_overrides_and_seed(tmp_path):
    sweep, space = tmp_path / "sweep.toml", tmp_path / "space.toml"
    sweep.write_text(f"{BASE}{AXIS}")
    space.write_text('seed = 7\nset = ["rig.width_px=96"]\n[space]\nstratum = "nominal"\nscenes = 3\n')
    for path in (sweep, space):
        for scene in read_campaign(path).scenes():
            assert read_scenario(scene.base, scene.overrides, scene.seed) == scene.scenario


def test_the_base_scenario_stands_beside_the_campaign(tmp_path):
    (tmp_path / "mine.toml").write_text("[rig]\nbaseline_m = 0.25\n[layout]\n")
    (tmp_path / "c.toml").write_text('scenario = "mine.toml"\n')
    (scene,) = read_campaign(tmp_path / "c.toml").scenes()
    assert scene.scenario.rig.baseline_m == 0.25


def test_the_fingerprint_changes_with_the_campaign_and_its_base_scenario_and_not_with_comments(tmp_path):
    base, path = tmp_path / "mine.toml", tmp_path / "c.toml"
    base.write_text("[layout]\n")

    def fingerprint(text):
        path.write_text(text)
        return read_campaign(path).fingerprint()

    first = fingerprint('scenario = "mine.toml"\n')
    assert fingerprint('# a comment\nscenario   = "mine.toml"\n') == first
    assert fingerprint('scenario = "mine.toml"\nrepeats = 2\n') != first
    base.write_text("[layout]\nn_leaks = 2\n")
    assert fingerprint('scenario = "mine.toml"\n') != first


@pytest.mark.parametrize("name", CAMPAIGNS.names())
def test_every_shipped_campaign_is_valid_and_says_what_it_is_for(name):
    file = read_campaign(name)
    assert file.campaign.name == name
    assert file.campaign.description
    result = CliRunner().invoke(main, ["campaign", "check", name])
    assert (result.exit_code, f"{file.campaign.n_scenes} scenes" in result.output) == (0, True)


def test_variants_that_are_scenes_of_their_own_have_draws_of_their_own_the_same_along_every_axis():
    crowded = read_campaign("paper_crowded").scenes()
    seeds = {(s.arm.values["scene"], s.arm.values["gamma.dose_rate_gy_h"]): s.seed for s in crowded}
    assert len(seeds) == 24
    assert len(set(seeds.values())) == 8
    assert seeds["3", 1.7] == seeds["3", 10.0]
    multiple = read_campaign("paper_multiple").scenes()
    assert len({scene.seed for scene in multiple}) == len(multiple) == 8


def test_the_papers_crowded_scenes_are_the_shipped_ones():
    for scene in read_campaign("paper_crowded").scenes():
        shipped = read_scenario(f"crowded_{scene.arm.values['scene']}")
        assert [(leak.x_m, leak.y_m) for leak in scene.scenario.leak] == [(leak.x_m, leak.y_m) for leak in shipped.leak]


def test_fewer_frames_are_the_same_clips_cut_short():
    separated, frames = read_campaign("paper_separated").scenes(), read_campaign("paper_frames").scenes()
    assert [scene.scenario for scene in separated if scene.scenario.gamma.dose_rate_gy_h == 10.0] == [
        scene.scenario for scene in frames if scene.scenario.recording.n_frames == 24
    ]


def test_a_campaign_can_be_run_with_other_repeats_and_keeps_its_first_seeds(tmp_path):
    file = read_campaign("noise")
    few, more = repeated(file, 2), repeated(file, 3)
    assert (few.campaign.n_scenes, few.fingerprint() != file.fingerprint()) == (16, True)
    assert {scene.seed for scene in few.scenes()} < {scene.seed for scene in more.scenes()}
    with pytest.raises(CampaignError, match="at most 100000 runs"):
        repeated(file, 10_000)
    (tmp_path / "space.toml").write_text('[space]\nstratum = "easy"\nscenes = 2\n')
    with pytest.raises(CampaignError, match="a \\[space\\] has scenes"):
        repeated(read_campaign(tmp_path / "space.toml"), 2)


def test_the_schema_of_a_campaign_is_printed():
    assert "axis" in json.loads(CliRunner().invoke(main, ["schema", "campaign"]).output)["properties"]


def test_a_space_of_which_some_scene_cannot_be_is_refused_before_it_runs(tmp_path):
    # the first scene has one leak, the fifth four
    path = tmp_path / "space.toml"
    path.write_text(
        'set = ["layout.min_separation_m=2.4"]\nmethods = ["paper"]\n[space]\nstratum = "nominal"\nscenes = 12\n'
    )
    with pytest.raises(CampaignError, match=r"space\.toml: set: .*layout\.min_separation_m: . leaks do not fit"):
        read_campaign(path)


def test_a_campaign_knows_its_mesh_by_what_it_holds(tmp_path):
    (tmp_path / "s.toml").write_text('[[leak]]\nx_m = 1.0\ny_m = 0.0\n[[structure]]\nkind = "mesh"\npath = "m.stl"\n')
    (tmp_path / "c.toml").write_text('scenario = "s.toml"\nmethods = ["paper"]\n')
    with pytest.raises(CampaignError, match=r"scenario: structure\.0\.path: .*m\.stl: cannot be read: No such file"):
        read_campaign(tmp_path / "c.toml")
    os.mkfifo(tmp_path / "m.stl")  # it would be waited for
    with pytest.raises(CampaignError, match=r"m\.stl: must be a regular file"):
        read_campaign(tmp_path / "c.toml")
    (tmp_path / "m.stl").unlink()
    prints = set()
    for size_m in (0.1, 0.2, 0.1):
        trimesh.creation.box((size_m,) * 3).export(tmp_path / "m.stl")
        prints.add(read_campaign(tmp_path / "c.toml").fingerprint())
    assert len(prints) == 2


def test_an_estimator_named_twice_is_refused():
    file = CampaignFile("c.toml", Campaign(scenario="plain", methods=("paper",)), "plain")
    mine = EstimatorSpec("callable", "mine:locate")
    with pytest.raises(CampaignError, match="'mine:locate' is named twice"):
        Study(file, (mine, mine), Path("c.db")).identity()


def test_what_stands_for_the_unpublished_is_the_same_in_all_campaigns_of_the_paper():
    chosen = set()
    for experiment in EXPERIMENTS:
        for scene in read_campaign(experiment.campaign).scenes():
            drips = scene.scenario.leak or (scene.scenario.layout,)
            drops = {(drip.z_m, drip.drop_radius_m, drip.drip_period_s) for drip in drips}
            chosen.add((str(scene.scenario.pedestal), str(scene.scenario.lamp), *drops))
    assert len(chosen) == 1
