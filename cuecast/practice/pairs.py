"""Minimal pairs: lips or lips and hand, points or avatar, clear or after the channel.

One word is shown without sound, two are offered. The test of Gibert, Bailly and Elisei 2004,
section 5.1: whether synthetic cues can be identified by people.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from codec.cuer.motion import load_motion
from codec.cuer.voice import Voice, load_voice
from codec.errors import CueError
from cuecast.practice.doubles import minimal_pairs
from cuecast.practice.items import pair_items, through_channel
from cuecast.practice.trial import ItemCondition, Step, Trial, save_item, write_trial

PROMPT = "Quel mot la codeuse a-t-elle dit ?"

HANDS, DISPLAYS, CHANNELS = ("lips", "hand"), ("points", "avatar"), ("clear", "channel")

SIDES = 2
"""Trials of a condition are a multiple of this: each side is right equally often."""


@dataclass(frozen=True, slots=True)
class PairsPlan:
    """What a test of minimal pairs varies.

    Attributes
    ----------
    hands, displays, channels : tuple of str
        Levels that are crossed with each other.
    trials : int
        Trials of each condition for each participant, even.
    lost : float
        Share of superframes lost in the channel.
    """

    hands: tuple[str, ...] = HANDS
    displays: tuple[str, ...] = DISPLAYS
    channels: tuple[str, ...] = CHANNELS
    trials: int = 10
    lost: float = 0.05

    def __post_init__(self) -> None:
        if self.trials < SIDES or self.trials % SIDES:
            raise CueError(f"{self.trials} trials a condition: an even number is needed")
        for name, chosen, known in (
            ("hands", self.hands, HANDS),
            ("displays", self.displays, DISPLAYS),
            ("channels", self.channels, CHANNELS),
        ):
            if not chosen or set(chosen) - set(known) or len(set(chosen)) < len(chosen):
                raise CueError(f"{name} {','.join(chosen)!r}: choose from {', '.join(known)}")


def prepare(
    folder: Path,
    voice_name: str,
    plan: PairsPlan,
    *,
    seed: int = 0,
    pairs: Sequence[tuple[str, str]] | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Trial:
    """Make the items of a test and write it into a folder that exists.

    Raises
    ------
    CueError
        If a pair has words of different length.
    """
    voice = load_voice(voice_name)
    listed = minimal_pairs() if pairs is None else pairs
    pool = []
    for number, words in enumerate(listed):
        pool.append(_entry(folder, number, words, voice, plan, seed))
        progress(number + 1, len(listed))
    settings = {
        "hands": plan.hands,
        "displays": plan.displays,
        "channels": plan.channels,
        "trials": plan.trials,
        "lost": plan.lost,
    }
    trial = Trial(folder, "pairs", voice_name, seed, settings, pool)
    write_trial(trial)
    return trial


def _entry(
    folder: Path, number: int, words: tuple[str, str], voice: Voice, plan: PairsPlan, seed: int
) -> dict[str, Any]:
    motions = pair_items(words, voice, seed=seed)
    files: dict[str, list[str]] = {}
    for channel in plan.channels:
        shown = motions
        if channel == "channel":
            # Both words lose the same superframes: only their keys differ.
            shown = tuple(
                through_channel(
                    motion, voice, lost=plan.lost, rng=np.random.default_rng([seed, number])
                )
                for motion in motions
            )
        files[channel] = [
            save_item(folder, f"{number:03}-{member}-{channel}", motion)
            for member, motion in enumerate(shown)
        ]
    return {"words": list(words), "motions": files}


def steps(trial: Trial, number: int) -> list[Step]:
    """Return a participant's trials: conditions in random order, pairs used equally often."""
    rng = trial.rng(number)
    settings, pool = trial.settings, trial.pool
    crossed = [
        ItemCondition(*levels)
        for levels in itertools.product(
            settings["hands"], settings["displays"], settings["channels"]
        )
    ]
    wanted = int(settings["trials"])
    rounds = -(-wanted * len(crossed) // len(pool))
    order = np.concatenate([rng.permutation(len(pool)) for _ in range(rounds)])
    found = []
    for position, condition in enumerate(crossed):
        sides = rng.permutation(np.arange(wanted) % SIDES)
        for entry, target in zip(
            order[position * wanted : (position + 1) * wanted], sides, strict=True
        ):
            found.append(_step(pool[entry], condition, int(target), int(rng.integers(2))))
    return [found[i] for i in rng.permutation(len(found))]


def _step(entry: Any, condition: ItemCondition, target: int, member: int) -> Step:
    """Return the trial that shows word `member` of a pair and has it on side `target`."""
    words = entry["words"]
    shown, other = words[member], words[1 - member]
    return Step(
        item=shown,
        condition=condition,
        prompt=PROMPT,
        target=target,
        choices=(shown, other) if target == 0 else (other, shown),
        motion=entry["motions"][condition.channel][member],
    )


def read_by_machine(trial: Trial, progress: Callable[[int, int], None]) -> list[dict[str, Any]]:
    """Return how the Gaussian recogniser reads the items, one row per channel.

    The check of the paper (section 5.1): the recogniser of hand shapes and placements, fitted on
    the targets of the recorded units, reads the keys of every word at the hand's arrival, and
    chooses the word of the pair whose keys are likelier.

    Raises
    ------
    CueError
        If the recordings cannot be read.
    """
    from cuecast.dubbing.performance import unit_synthesiser
    from cuecast.evaluate.synthesis import learn
    from cuecast.practice.machine import MachineReading, read_word

    voice = load_voice(trial.voice)
    recogniser = learn(unit_synthesiser(voice).recordings, voice)
    rows = []
    for channel in trial.settings["channels"]:
        total = MachineReading(0, 0, 0, 0, 0)
        for number, entry in enumerate(trial.pool):
            clear = pair_items(entry["words"], voice, seed=trial.seed)
            scores = [motion.score for motion in clear if motion.score is not None]
            for member, file in enumerate(entry["motions"][channel]):
                motion = load_motion(trial.folder / file)
                total += read_word(motion, scores[member], scores[1 - member], recogniser, voice)
            progress(number + 1, len(trial.pool))
        rows.append({"channel": channel} | total.figures())
    return rows
