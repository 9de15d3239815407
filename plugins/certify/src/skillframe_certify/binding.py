"""The link between a claim and its fresh trials: the expected campaign, its code and its seed.

The exploratory trials and the claim determine the fresh campaign completely. Its seed is a hash of the rest of the
claim and of system entropy sampled when the claim is written. So nobody can know the trials earlier, and the claim
cannot be edited later.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from skillframe.campaign import (
    COPIES,
    Axis,
    CampaignSpec,
    RanAgain,
    campaign_hash,
    combined_hash,
    file_hashes,
    load,
    ran_again,
    read_content,
    software,
)
from skillframe.errors import InputError
from skillframe_certify.question import LOOK

SYSTEM, CALLER = "system", "caller"
FOLLOWS = ("seed", "campaign")
"""Keys of a claim that follow from the others."""
BACK = "put it back as it was; another skill, robot, world or setting is another question, with a folder of its own"


def draw_entropy() -> str:
    """Return 64 hexadecimal digits from the system's source of randomness."""
    return secrets.token_hex(32)


def seed_of(claim: Mapping[str, Any]) -> int:
    """Return the fresh seed of a claim, a hash of all keys but `FOLLOWS`."""
    digest = combined_hash({key: value for key, value in claim.items() if key not in FOLLOWS})
    return int.from_bytes(hashlib.sha256(digest.encode()).digest()[:6], "little")  # 48 bits, as for search rounds


def expected(folder: Path, claim: Mapping[str, Any], params: type | None) -> CampaignSpec:
    """Return the fresh campaign that follows from a claim and its exploratory trials."""
    spec = load(folder / LOOK, params)
    axes = {name: Axis(kind="uniform", numbers=(float(a), float(b))) for name, (a, b) in claim["boxes"][-1].items()}
    return replace(spec, vary={**spec.vary, **axes}, trials=int(claim["trials"]), seed=int(claim["seed"]))


def check_campaign(folder: Path, place: Path, claim: Mapping[str, Any], params: type | None) -> None:
    """Refuse fresh trials of another campaign than the claim announced.

    Raises:
        InputError: names the first difference.
    """
    announced, found = expected(folder, claim, params), load(place, params)
    if campaign_hash(announced) != claim["campaign"]:
        problem = f"is not as it was when claim {claim['number']} was written: the claim names another campaign"
        raise InputError(folder / LOOK, problem, BACK)
    for text in differences(announced, found):
        raise InputError(place, f"is not the campaign that claim {claim['number']} announced: {text}", BACK)


def differences(announced: CampaignSpec, found: CampaignSpec) -> Iterator[str]:
    """Yield a sentence for each difference between two campaigns, including their files."""
    then, now = (_flat(spec.plain()) for spec in (announced, found))
    for name in sorted(then.keys() | now.keys()):
        if then.get(name) != now.get(name):
            yield f"{name} is {now.get(name, 'absent')}, announced was {then.get(name, 'absent')}"
    before, after = (file_hashes(spec.folder, COPIES) for spec in (announced, found))
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) != after.get(name):
            kind = "was changed" if name in before and name in after else "is gone" if name in before else "was added"
            yield f"{name} {kind}"


def _flat(plain: Mapping[str, Any]) -> dict[str, Any]:
    tables = {"fixed": "set", "vary": "vary", "stop": "stop", "expect": "expect"}
    flat = {key: value for key, value in plain.items() if key not in tables}
    return flat | {f"{tables[key]}.{name}": v for key in tables for name, v in plain[key].items()}


def check_software(place: Path, claim: Mapping[str, Any], now: Mapping[str, str]) -> None:
    """Refuse to run a claim's trials with different code.

    Raises:
        InputError: names the difference.
    """
    for text in others(claim["software"], software(now)):
        raise InputError(place, f"was claimed with other code: {text}", "install it again as it was")


def check_rows(place: Path, claim: Mapping[str, Any], params: type | None) -> RanAgain | None:
    """Refuse rows of other code than the claim's, and return which trials ran more than once.

    Raises:
        InputError: names the difference and a trial.
    """
    spec = load(place, params)
    content = read_content(place, campaign_hash(spec), spec)
    for number, environment in enumerate(content.environments):
        trials = [trial for trial, label in content.done if content.done.ran_on((trial, label)) == number]
        for text in others(claim["software"], software(environment)) if trials else ():
            problem = f"trial {trials[0]} ran with other code than the claim was written with: {text}"
            raise InputError(place, problem, "what those trials show is not what was claimed")
    return ran_again(content.sessions, content.done)


def others(then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    """Yield a sentence for each version or code hash that differs."""
    for name in sorted(then.keys() | now.keys()):
        if then.get(name) != now.get(name):
            yield f"{name} was {then.get(name, 'absent'):.16}, now it is {now.get(name, 'absent'):.16}"
