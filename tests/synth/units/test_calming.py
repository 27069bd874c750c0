import numpy as np

from codec.cuer.voice import load_voice
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.text_score import score_of_text
from synth.units.concatenation.trajectories import calm_joins, quickest

RATE_HZ = 50.0


def test_quick_joins_are_slowed_and_nothing_else_changes() -> None:
    voice = load_voice()
    score = score_of_text("Le chat boit du lait et il a bien soif.", start_s=1.0)
    cuer = GestureSynthesiser(rate_hz=RATE_HZ)
    motion = cuer.motion(score, 0.0, 200, voice)
    params = motion.params.astype(np.float64)
    columns = [i for i, name in enumerate(voice.layout) if not name.startswith("face.")]

    def speed(p: np.ndarray) -> np.ndarray:
        steps = np.diff(voice.reconstruct(p), axis=0)
        return np.asarray(np.linalg.norm(steps, axis=-1).max(1) * RATE_HZ)

    own = speed(params)
    quick = int(own[20:-20].argmax()) + 20
    limit = 0.8 * float(own[quick])
    far = np.array([-3, 0, 5, quick, 400])
    calmed = calm_joins(params, columns, far, voice, limit_mm_s=limit, rate_hz=RATE_HZ)
    assert speed(calmed)[quick] <= limit
    assert speed(calmed)[quick - 1] <= limit
    still = np.abs(np.arange(200) - quick) > 25
    np.testing.assert_allclose(calmed[still], params[still], atol=1e-4)
    face = [i for i in range(params.shape[1]) if i not in columns]
    np.testing.assert_array_equal(calmed[:, face], params[:, face])
    calm = calm_joins(params, columns, far, voice, limit_mm_s=10 * limit, rate_hz=RATE_HZ)
    np.testing.assert_array_equal(calm, params)
    assert 0.3 * own.max() < quickest([motion], voice) <= own.max()
