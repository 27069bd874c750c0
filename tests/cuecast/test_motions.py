"""Motion made window by window, against motion made at once."""

import numpy as np
import pytest

from codec.errors import CueError
from codec.score import Score
from codec.voice import Voice, load_voice
from cuecast.motions import JoinedMotion, ruled_motion
from synth.concatenation import ConcatenativeSynthesiser
from synth.gesture import GestureSynthesiser
from synth.rendered import record
from synth.score import score_from_subtitles, stream_score
from synth.subtitles import Subtitle

LINES = (
    Subtitle(0.6, 2.0, "Le chat boit du lait."),
    Subtitle(2.2, 3.4, "Il a bien soif !"),
    Subtitle(6.0, 7.2, "Et toi ?"),
    Subtitle(8.4, 9.6, "Moi non plus."),
)


@pytest.fixture(scope="module")
def voice() -> Voice:
    return load_voice("claire")


def test_rules_make_the_same_motion_from_pieces_as_from_the_whole(voice: Voice) -> None:
    score = score_from_subtitles(LINES)
    parts = list(ruled_motion(stream_score(LINES), GestureSynthesiser(seed=4), voice))
    made = np.concatenate([part.params for part in parts])
    whole = GestureSynthesiser(seed=4).motion(score, 0.0, len(made), voice)
    np.testing.assert_allclose(made, whole.params, atol=1e-4)
    assert tuple(k for part in parts if part.score for k in part.score.keys) == score.keys
    assert len(made) / 50 == pytest.approx(score.phones[-1].end + 1.0, abs=0.03)


def test_windows_of_joined_units_do_not_depend_on_their_order(voice: Voice) -> None:
    texts = ("Le chat boit du lait, il a bien soif.", "Et toi, moi non plus !")
    units = ConcatenativeSynthesiser(
        list(record(texts, GestureSynthesiser(alignment="paper"), voice)), voice
    )
    score = score_from_subtitles(LINES)
    whole = [part.motion for part in units.perform([score], start_s=0.0)]
    params = np.concatenate([part.params for part in whole])
    source = JoinedMotion(score, units)
    for k in (0, 1, 2, 7, 11, 14, 3, 0):
        window = source.window(k * 0.64, 32)
        np.testing.assert_allclose(window.params, params[k * 32 : (k + 1) * 32], atol=2e-4)
    late = source.window(60.0, 8)
    np.testing.assert_allclose(late.params, np.repeat(params[-1:], 8, axis=0), atol=2e-4)
    with pytest.raises(CueError, match="nothing is said"):
        JoinedMotion(Score((), ()), units)
