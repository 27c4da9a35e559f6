"""`leakloc reproduce` from end to end on tiny images: one command, whole or not at all, the same on any workers."""

import csv
import json
import re
import sqlite3
from html import unescape

import pytest
from click.testing import CliRunner
from small_campaigns import inline

from scenarios.cli import main
from scenarios.evaluation import FULL, QUICK, campaign_files, evaluating, store_paths
from scenarios.evaluation_tables import flattened
from scenarios.store import read_store

pytestmark = pytest.mark.xdist_group("reproduce")  # one worker: what they share is made once

TINY = ("rig.width_px=96", "rig.height_px=54", "pedestal.texture=uniform")
SIZE = ["--quick", "--scenes", "1", *(word for override in TINY for word in ("--set", override))]
N_SCENES = 20
SAME = ("report.html", "tables.json", "tables.csv", "figures/figure_6.svg", "figures/figure_7_H.svg")


def reproduce(destination, *words):
    return CliRunner().invoke(main, ["reproduce", "-o", str(destination), *SIZE, *words])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A tiny evaluation that one worker made without a stop; only to be read."""
    folder = tmp_path_factory.mktemp("reproduced") / "out"
    result = reproduce(folder, "--workers", "1")
    assert result.exit_code == 0, result.output
    return folder, result.output


def test_one_command_makes_tables_figures_and_one_offline_page(made):
    folder, said = made
    assert [path.name for path in folder.parent.iterdir()] == ["out"]
    assert sorted(path.name for path in folder.iterdir()) == [
        *("figures", "report.html", "stores", "tables.csv", "tables.json")
    ]
    names = ["figure_6", "figure_7_H", "figure_7_L", "figure_7_M", "figure_8_5", "figure_8_7"]
    assert sorted(path.stem for path in (folder / "figures").iterdir()) == names
    page = (folder / "report.html").read_text()
    assert not re.search(r"(src|href)=.?(https?:|//)", page.replace('xlink:href="#', ""))
    assert page.count("<svg") == len(names)
    for words in ("26/30", "0.22 ± 0.25 m", "Clopper-Pearson", "layout.drop_radius_m", "without drop shadows"):
        assert words in page
    assert "separated   H" in said
    assert "bars are met" in said


def test_the_worst_scene_of_each_method_is_shown_with_the_command_that_explains_it(made):
    folder, _ = made
    worst = json.loads((folder / "tables.json").read_text())["worst"]
    page = unescape((folder / "report.html").read_text())
    assert "paper" in [one["method"] for one in worst]
    assert page.count("data:image/png;base64,") >= len(worst)
    for one in worst:
        assert one["words"] in page
        assert one["replay"] in page
        assert one["replay"].startswith("leakloc explain")
        assert f"--method {one['method']}" in one["replay"]


def test_the_page_holds_the_rows_of_the_data_each_beside_its_own_setting_and_method(made):
    folder, _ = made
    page = (folder / "report.html").read_text()
    tables = page[page.index("<h2>Tables</h2>") : page.index("<h2>Figures</h2>")]
    shown = [
        (*re.findall('<td class="text">(.*?)</td>', row), re.search(r"<td>(\d+)</td>", row)[1], row)
        for row in re.findall("<tr>(<td.*?)</tr>", tables)
    ]
    rows = json.loads((folder / "tables.json").read_text())["rows"]
    # By experiment, a table by the paper's rule and one by the gate.
    names = dict.fromkeys(row["experiment"] for row in rows)
    wanted = [
        (row, row[rule])
        for name in names
        for rule in ("paper_rule", "gated")
        for row in rows
        if row["experiment"] == name
    ]
    assert len(shown) == len(wanted)
    for (setting, method, clips, cells), (row, part) in zip(shown, wanted, strict=True):
        assert (setting, method, int(clips)) == (row["setting"], row["method"], row["n_clips"])
        for found in part["found"].values():
            interval = f"[{found['clips_low']:.2f}, {found['clips_high']:.2f}]"
            told = f"{found['leaks']}/{found['of_leaks']}<br>{found['clips']}/{found['of_clips']} {interval}"
            assert f"<td>{told}</td>" in cells


def test_nothing_that_is_undefined_is_printed_as_a_number_or_an_interval(made):
    folder, said = made
    page = re.sub('<svg.*?</svg>|base64,[^"]*', "", (folder / "report.html").read_text(), flags=re.DOTALL)
    data = (folder / "tables.json").read_text()
    assert '"mean_m": null' in data  # or this shows nothing
    assert '"low_m": null' in data
    for text in (page, said, data, (folder / "tables.csv").read_text()):
        assert re.findall(r".{20}(?:\bnan\b|\[-,).{20}", text, flags=re.IGNORECASE) == []


def test_json_and_csv_agree_and_hold_every_row(made):
    folder, _ = made
    data = json.loads((folder / "tables.json").read_text())
    rows = list(csv.DictReader((folder / "tables.csv").read_text().splitlines()))
    assert len(rows) == 2 * (3 + 2 + 1 + 2 + 3)
    for row, from_json in zip(rows, data["rows"], strict=True):
        assert {key: cell for key, cell in row.items() if cell} == {
            key: str(value) for key, value in flattened(from_json).items()
        }
    assert [row["published"]["found"] for row in data["rows"][:2]] == [26, 26]
    assert {"key": "layout.drop_radius_m", "value": "0.0115", "unit": "m"}.items() <= data["assumptions"][0].items()


def test_a_stopped_run_goes_on_with_two_workers_to_the_same_bytes(made, tmp_path):
    whole, _ = made
    out, unfinished = tmp_path / "out", tmp_path / "out.unfinished"
    files = campaign_files(QUICK.__class__(**{**vars(QUICK), "separated": 1}), TINY)
    with evaluating(files, unfinished, inline()) as under_way:
        assert (under_way.n_scenes, under_way.n_there) == (N_SCENES, 0)
        for _ in range(5):
            next(under_way.left)
    result = reproduce(out, "--workers", "2")
    assert result.exit_code == 0, result.output
    assert f"5 of {N_SCENES} scenes are there already" in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    for name in SAME:
        assert (out / name).read_bytes() == (whole / name).read_bytes(), name
    for name in files:
        assert read_store(out / "stores" / f"{name}.db") == read_store(whole / "stores" / f"{name}.db")


def test_a_folder_that_is_taken_is_refused_before_the_work(made, tmp_path):
    folder, _ = made
    before = (folder / "tables.json").read_bytes()
    result = reproduce(folder)
    assert (result.exit_code, "--force" in result.output) == (2, True)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "tables.json").write_text('{"made_by": "me"}')
    for words in ([], ["--force"]):
        result = reproduce(tmp_path / "mine", *words)
        assert (result.exit_code, result.output.count("\n")) == (2, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    assert (folder / "tables.json").read_bytes() == before


def test_a_demo_is_not_replaced_by_an_evaluation(tmp_path, monkeypatch):
    monkeypatch.setattr("scenarios.reproduce.findings_of", lambda _: pytest.fail("must be refused before"))
    (tmp_path / "demo.json").write_text('{"made_by": "leakloc 0.1"}')
    result = reproduce(tmp_path, "--force")
    assert (result.exit_code, "something else" in result.output) == (2, True)


def test_another_size_or_version_has_stores_of_its_own(tmp_path, monkeypatch):
    full = store_paths(campaign_files(FULL), tmp_path)
    quick = store_paths(campaign_files(QUICK), tmp_path)
    assert not set(full.values()) & set(quick.values())
    monkeypatch.setattr("scenarios.run_campaign.versions", lambda: "leakloc 9")
    assert not set(store_paths(campaign_files(FULL), tmp_path).values()) & set(full.values())


def test_a_mistaken_override_is_told_in_one_line_and_nothing_is_made(tmp_path):
    result = CliRunner().invoke(main, ["reproduce", "-o", str(tmp_path / "out"), "--set", "rig.width=96"])
    assert (result.exit_code, "rig.width" in result.output) == (2, True)
    assert list(tmp_path.iterdir()) == []


def test_a_store_of_an_evaluation_is_a_campaigns_store(made):
    folder, _ = made
    result = CliRunner().invoke(main, ["campaign", "show", str(folder / "stores" / "crowded.db")])
    assert (result.exit_code, "paper_crowded, 8 of 8 scenes" in result.output) == (0, True)
    connection = sqlite3.connect(folder / "stores" / "crowded.db")
    ((n_runs,),) = connection.execute("SELECT COUNT(*) FROM run")
    connection.close()
    assert n_runs == 16
