"""Sound inputs of every kind for the fuzzer, made by the program itself, and its command line with the long work cut.

A damaged campaign may well ask for a million sound trials. What is fuzzed is reading, so simulating and computing rows
end at once with what Ctrl-C raises; one run of a skill goes on for two hundredths of a second.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from skillframe_testkit.suites import example_demonstrations

from plugins.recordings.tests.bags_written import ENDINGS, poses, wrenches, write_bag
from skillframe.cli.main import run as run_command
from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import write_demonstration
from tests.oracle.fuzz import Case
from tests.unit.demonstration.conftest import make

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGN = """name = "fuzzed"
seed = 7
trials = 3
robot = "free_tool"
world = "free"
skills = ["peg.skill.json"]
duration_s = 0.02
[vary]
"start.tilt_y" = { uniform = [-0.1, 0.1] }
"start.offset_x" = { normal = [0.0, 0.002] }
[set]
"start.offset_y" = 0.001
[expect]
rate = 0.0
"""
META = """task = "peg"
teacher = "kinesthetic"
rate = 100.0
[frames]
hand = [0.0, 0.0, -0.1]
[sensor]
force_noise = 0.1
[wrench]
frame = "base"
sign = "environment"
point = [0.0, 0.0, 0.0]
"""
SHORT = ["--world", "free", "--robot", "free_tool", "--duration", "0.02"]
NUMERIC = [
    ["run", "{}/peg.skill.json", *SHORT, "--seed", "#"], ["run", "{}/peg.skill.json", *SHORT, "--rate", "#"],
    ["run", "{}/peg.skill.json", *SHORT, "--set", "start.offset_x=#"],
    ["run", "{}/peg.skill.json", *SHORT, "--set", "sensor.force_noise=#"],
    ["run", "{}/peg.skill.json", *SHORT, "--coc", "0,0,#"], ["check", "{}/demo.csv", "--set", "rate=#"],
    ["convert", "{}/demo.csv", "--set", "from=#", "--out", "{}/out/a.npz"],
    ["convert", "{}/demo.csv", "--set", "to=#", "--out", "{}/out/a.npz"],
    ["filter", "{}/demo.csv", "--corner", "#", "--out", "{}/out/a.npz"],
    ["filter", "{}/demo.csv", "--free-air", "0,#", "--out", "{}/out/a.npz"],
    ["export", "{}/peg.skill.json", "--to", "crisp", "--phase", "#", "--out", "{}/out/a.yaml"],
    ["export", "{}/peg.skill.json", "--to", "crisp", "--orientation", "0,0,#,1", "--out", "{}/out/a.yaml"],
    ["learn", "{}/demo.csv", "--at", "#,0,0", "--out", "{}/out/a.json"],
    ["campaign", "replay", "{}/folder", "#"],
]  # fmt: skip


def stop_long_work() -> None:
    """In this process and its children only."""
    import skillframe_papers.runner

    import skillframe.campaign.runner

    def cut(*_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt

    skillframe.campaign.runner.run_campaign = cut
    skillframe_papers.runner._Session.work_off = cut  # type: ignore[method-assign]


def command(arguments: list[str]) -> int:
    """What is fuzzed."""
    return run_command(arguments)


def read(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def do(*arguments: object) -> None:
    code = run_command([str(word) for word in arguments])
    assert code in (0, 1), (arguments, code)


def some(count: int, shift: float = 0.0) -> Demonstration:
    demo = make(count=count, seed=int(10 * shift))
    return Demonstration(
        time=demo.time, position=demo.position + shift * np.array([0.0, 0.01, 0.0]), quaternion=demo.quaternion,
        wrench=demo.wrench,
    )  # fmt: skip


def cases(folder: Path) -> list[Case]:
    """Every kind of input, sound."""
    made = [*recordings(folder / "recordings"), *skills(folder / "skills")]
    skill = made[-1].files["peg.skill.json"]
    made += [*robots(), *campaigns(folder / "campaign", skill), *fmus()]
    results = next(case for case in made if case.kind == "rows.jsonl").files
    demo = next(case for case in made if case.kind == "csv").files["demo.csv"]
    inside = {"peg.skill.json": skill, "demo.csv": demo, **{f"folder/{n}": c for n, c in results.items()}}
    return [*made, Case("typed numbers", inside, "", NUMERIC, 1.0), *rows_of_papers(folder / "reproduce")]


def recordings(folder: Path) -> list[Case]:
    folder.mkdir()
    demo = some(60)
    for name in ("demo.csv", "demo.npz"):
        write_demonstration(demo, folder / name)
    text = (folder / "demo.csv").read_bytes()
    found = []
    for name, share in (("demo.csv", 2.0), ("demo.npz", 2.0)):
        commands = [["check", f"{{}}/{name}"]] * 3
        commands += [["convert", f"{{}}/{name}", "--out", "{}/out/a.npz"]]
        commands += [["filter", f"{{}}/{name}", "--no-bias", "--out", "{}/out/a.csv"]]
        commands += [["learn", f"{{}}/{name}", "--out", "{}/out/a.json"]]
        found.append(Case(name[5:], {name: (folder / name).read_bytes()}, name, commands, share))
    columns = "t,px,py,pz,qx,qy,qz,qw,fx,fy,fz,tx,ty,tz"
    blank = b"\n".join(text.replace(b",", b" ").splitlines()[1:]) + b"\n"
    given = [["check", "{}/demo.txt", "--set", f"columns={columns}"]]
    found.append(Case("delimited text", {"demo.txt": blank}, "demo.txt", given))
    files = {"demo.csv": text, "demo.meta.toml": META.encode()}
    found.append(Case("meta.toml", files, "demo.meta.toml", [["check", "{}/demo.csv"]], 2.0))
    short = some(30)
    for ending in ENDINGS:
        (folder / ending[1:]).mkdir()
        topics = {"/tool": poses(short), "/ft": wrenches(short)}
        bag = write_bag(folder / ending[1:] / f"demo{ending}", topics).read_bytes()
        found.append(Case(ending, {f"demo{ending}": bag}, f"demo{ending}", [["check", f"{{}}/demo{ending}"]]))
    return found


def skills(folder: Path) -> list[Case]:
    folder.mkdir()
    names = []
    for i, demonstration in enumerate(example_demonstrations()):
        names.append(str(folder / f"{i}.npz"))
        write_demonstration(demonstration, Path(names[-1]))
    do("learn", *names, "--out", folder / "peg.skill.json")
    do("segment", *names, "--phases", "2", "--out", folder / "policy.json")
    policy, skill = ((folder / name).read_bytes() for name in ("policy.json", "peg.skill.json"))
    show = [["show", "{}/policy.json"]]
    return [
        Case("policy.json", {"policy.json": policy}, "policy.json", show, 2.0),
        Case(
            "skill.json", {"peg.skill.json": skill}, "peg.skill.json",
            [
                *[["show", "{}/peg.skill.json"]] * 3,
                ["show", "{}/peg.skill.json", "--page", "{}/out/a.html"],
                ["export", "{}/peg.skill.json", "--to", "crisp", "--out", "{}/out/a.yaml"],
                ["run", "{}/peg.skill.json", *SHORT, "--out", "{}/out/a.npz"],
            ], 2.0,
        ),
    ]  # fmt: skip


def robots() -> list[Case]:
    found = []
    for name in ("free_tool", "panda"):
        files = {n: c for n, c in read(ROOT / "robots" / name).items() if n.endswith((".toml", ".urdf"))}
        files = {f"{name}/{n}": c for n, c in files.items()}
        for target in files:
            kind = "robot.toml" if target.endswith(".toml") else "URDF"
            check = [["robots", "--check", f"{{}}/{target}"], ["robots", f"{{}}/{name}/robot.toml"]]
            found.append(Case(kind, files, target, check, 0.6))
    return found


def campaigns(folder: Path, skill: bytes) -> list[Case]:
    folder.mkdir()
    (folder / "peg.skill.json").write_bytes(skill)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    do("campaign", "run", folder / "campaign.toml", "--out", folder / "results", "--traces", "1")
    given, results = {"campaign.toml": CAMPAIGN.encode(), "peg.skill.json": skill}, read(folder / "results")
    results = {name: content for name, content in results.items() if name != "lock"}
    trace = next(name for name in results if name.startswith("traces/"))
    few = {name: content for name, content in results.items() if name != trace}  # most of a page's time is its drawing
    page = [["report", "{}", "--out", "{}/out/a.html"]]
    state = [["campaign", "status", "{}"], ["campaign", "status", "{}", "--json"]]
    prepare = [["campaign", "run", "{}/campaign.toml", "--out", "{}/out/r"]]
    single = [["report", "{}/a.npz", "--out", "{}/out/a.html"]]
    return [
        Case("campaign.toml", given, "campaign.toml", prepare, 2.0),
        Case("campaign.toml as run", few, "campaign.toml", [*state, *page]),
        Case("rows.jsonl", results, "rows.jsonl", state, 2.0),
        Case("results.csv", few, "results.csv", page),
        Case("summary.json", few, "summary.json", page),
        Case("scene.json", few, "scene.json", page, 0.5),
        Case("campaign's skill", few, "skills/peg.skill.json", [*state, *page], 0.2),
        Case("campaign's trace", results, trace, page, 0.1),
        Case("trace", {"a.npz": results[trace]}, "a.npz", single, 2.0),
    ]  # fmt: skip


def rows_of_papers(folder: Path) -> list[Case]:
    """A row as the store keeps it; damaged, it is shown or computed again, which is cut."""
    from skillframe_papers import store
    from skillframe_papers.jobs import jobs_of

    from skillframe.extend import RowResult
    from skillframe.extend.registry import registry

    row = registry().names("row")[0]
    job = jobs_of(registry(), [row], {}, seed=0, quick=True)[0]
    result = RowResult(
        ours="0.1", verdict="reported", values={"a": 0.1}, head=("a", "b"), rows=(("1", "2"),), computed=True
    )
    store.keep(folder, store.entry(registry().row(row), job, result, 1.0, 1.0))
    files = read(folder)
    target = next(iter(files))
    return [Case("reproduce store", files, target,
                 [["reproduce", row, "--quick", "--out", "{}"]])]  # fmt: skip


def fmus() -> list[Case]:
    """An FMU that is checked; without a C compiler there is none."""
    if shutil.which("cc") is None:
        return []
    from skillframe.fmu.build import find_fmu

    content = Path(find_fmu("hydraulic_cylinder")).read_bytes()
    check = ["fmu", "{}/a.fmu"]
    return [Case("fmu", {"a.fmu": content}, "a.fmu", [check, [*check, "--json"]], 0.3)]
