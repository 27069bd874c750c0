"""The lips after the broadcast: dubbed, coded as television does, received, drawn."""

import difflib
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from codec.cuer import layout
from codec.cuer.layout import MARKER_NUMBER
from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import Voice, load_voice
from codec.cues.cueing import PLACEMENT_OF, SHAPE_OF
from codec.cues.phonology import PHONES
from codec.cues.score import Phone
from cuecast.demo.content import FS, make_sound
from cuecast.dubbing.dub import DubOptions, dub
from cuecast.dubbing.motions import SynthesisedMotion
from cuecast.dubbing.receive import receive
from cuecast.media.film import write_film
from receiver.media.sound import read_sound
from synth.language.subtitles import Subtitle, read_subtitles
from synth.planning.prosody.pacing import READABLE
from synth.planning.scoring.text_score import Reading, score_of_subtitles

TWINS_MM = 0.7
"""Visemes that are nearer to each other are one to the eye: the a of *patte* and *pâte*."""

LATE_S = 0.15
"""Seconds by which a phone's time may be rounded on the way."""

LIPS = [MARKER_NUMBER[n] for n in (*layout.UPPER_LIP, *layout.LOWER_LIP, *layout.LIP_CORNERS)]


ROOT = Path(__file__).parents[2]

FILM = ROOT.parent / "shared" / "data" / "audio" / "film_mix.flac"
"""A man's voice over an orchestra: `robust` loses superframes on the demonstration's few tones."""


def demonstration(folder: Path) -> list[Subtitle]:
    """Write the demonstration's sound as ``a.flac`` and return what is said in it."""
    sound, subtitles = make_sound()
    write_film(folder / "a.flac", sound, FS, encoder="flac")
    return subtitles


def film(folder: Path) -> list[Subtitle]:
    """Write that of a film with a poem."""
    if not FILM.is_file():
        pytest.skip("no ../shared/data beside the project")
    shutil.copyfile(FILM, folder / "a.flac")
    return list(read_subtitles(ROOT / "tests" / "data" / "une_charogne.srt"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("programme", "profile", "bit_rate", "least"),
    [
        (demonstration, "standard", 128_000, {"consonants": 0.97, "vowels": 0.95}),
        (film, "robust", 64_000, {"consonants": 0.9, "vowels": 0.9}),
    ],
)
def test_lips_keep_their_word(
    tmp_path: Path,
    programme: Callable[[Path], list[Subtitle]],
    profile: str,
    bit_rate: int,
    least: dict[str, float],
) -> None:
    voice = load_voice()
    score = score_of_subtitles(programme(tmp_path), reading=Reading(pace=READABLE))
    options = DubOptions(audio_codec="flac", profiles={"audio": profile})
    dub(tmp_path / "a.flac", SynthesisedMotion(score, voice), voice, tmp_path / "b.flac", options)
    write_film(
        tmp_path / "c.m4a", *read_sound(tmp_path / "b.flac"), encoder="aac", bit_rate=bit_rate
    )
    received = receive(tmp_path / "c.m4a", voice).motion
    assert received is not None
    heard = arrived(score.phones, (received.score or score).phones)
    assert len(heard) > 0.9 * len(score.phones)
    gaps = [closing(voice, received, p) for p in heard if p.symbol in "pbm"]
    assert len(gaps) >= 5
    told = {
        "consonants": [told_apart(voice, received, p) for p in heard if p.symbol in SHAPE_OF],
        "vowels": [told_apart(voice, received, p) for p in heard if p.symbol in PLACEMENT_OF],
    }
    shares = {name: sum(right) / len(right) for name, right in told.items()}
    print(
        f"{profile}, AAC {bit_rate}: {len(heard)} of {len(score.phones)} phones heard, "
        f"{len(gaps)} bilabials off by {min(gaps):.2f} to "
        f"{max(gaps):.2f} mm; " + ", ".join(f"{n} {sum(t)} of {len(t)}" for n, t in told.items())
    )
    assert max(gaps) <= 0.5, "a closure stays open"
    assert min(gaps) >= -1.0, "lips are pressed through each other"
    for name, share in least.items():
        assert shares[name] >= share, name


def arrived(sent: tuple[Phone, ...], received: tuple[Phone, ...]) -> list[Phone]:
    """Return the received phones that were sent, in order: `robust` rounds their times."""
    one, other = ([phone.symbol for phone in line] for line in (sent, received))
    blocks = difflib.SequenceMatcher(None, one, other, autojunk=False).get_matching_blocks()
    pairs = [(sent[b.a + i], received[b.b + i]) for b in blocks for i in range(b.size)]
    return [found for phone, found in pairs if abs(found.start - phone.start) < LATE_S]


def lips_of(voice: Voice, face: np.ndarray) -> np.ndarray:
    """Return the markers of the lips, head and hand at rest, shape (N, L, 3), mm."""
    params = np.zeros((len(face), len(voice.layout)), dtype=np.float32)
    params[:, :N_FACE_PARAMETERS] = face
    return voice.reconstruct(params)[:, LIPS].astype(float)


def face_at(motion: Motion, times_s: np.ndarray) -> np.ndarray:
    return np.asarray(sample_params(motion, times_s)[:, :N_FACE_PARAMETERS])


def closing(voice: Voice, motion: Motion, phone: Phone) -> float:
    """Return by how much the lips are farther apart than those of the phone's viseme, mm."""
    middle = 0.5 * (phone.start + phone.end)
    lips = lips_of(voice, face_at(motion, np.array([middle])))
    wanted = lips_of(voice, viseme(voice, phone.symbol))
    upper, lower = (LIPS.index(MARKER_NUMBER[name]) for name in ("UL0", "LL0"))
    apart = [float(x[0, upper, 1] - x[0, lower, 1]) for x in (lips, wanted)]
    return apart[0] - apart[1]


def told_apart(voice: Voice, motion: Motion, phone: Phone) -> bool:
    """Return whether no phone of the same hand shape or placement looks more alike."""
    lips = lips_of(voice, face_at(motion, np.array([0.5 * (phone.start + phone.end)])))
    table = dict[str, object](SHAPE_OF if phone.symbol in SHAPE_OF else PLACEMENT_OF)
    own = lips_of(voice, viseme(voice, phone.symbol))
    away = distance(lips, own)
    for rival in table:
        if table[rival] != table[phone.symbol] or rival == phone.symbol:
            continue
        other = lips_of(voice, viseme(voice, rival))
        if distance(other, own) > TWINS_MM and distance(lips, other) < away:
            return False
    return True


def viseme(voice: Voice, symbol: str) -> np.ndarray:
    return voice.gestures.viseme_targets[[PHONES.index(symbol)]]


def distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other, axis=2).mean())
