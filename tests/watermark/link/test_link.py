import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.audio.signal.profile import HIGH, ROBUST, STANDARD, AudioProfile
from watermark.link import _kernels
from watermark.link.crc import crc_bits
from watermark.link.keystream import stream_words
from watermark.link.link import L0_CHECK, SIGNIFICANT_RATE, Link, _Class
from watermark.link.polar import longest_mother, make_code


def ratios(coded: NDArray[np.int64]) -> NDArray[np.float64]:
    """Of bits as they were sent."""
    return np.asarray(1.0 - 2.0 * coded, dtype=np.float64)


def noisy(coded: NDArray[np.int64], amplitude: float, seed: int) -> NDArray[np.float64]:
    """Log-likelihood ratios of BPSK at `amplitude` in unit noise."""
    rng = np.random.default_rng(seed)
    mean = (1.0 - 2.0 * coded) * amplitude
    return np.asarray(2 * amplitude * (mean + rng.normal(size=coded.size)), dtype=np.float64)


@given(st.binary(min_size=20, max_size=20), st.binary(min_size=7, max_size=7))
@settings(max_examples=20)
def test_round_trip(l0: bytes, l1: bytes) -> None:
    link = Link(STANDARD)
    coded = link.encode(l0, l1)
    decoded = link.decode(1.0 - 2.0 * coded.astype(np.float64))
    assert (decoded.l0, decoded.l1) == (l0, l1)
    np.testing.assert_array_equal(decoded.coded, coded)


def test_payload_of_the_wrong_length() -> None:
    for size in (3, 6, 8):
        with pytest.raises(CueError, match=rf"^L1 holds {size} bytes, the profile 7$"):
            Link(STANDARD).encode(bytes(20), bytes(size))
    with pytest.raises(CueError, match=r"^L0 holds 19 bytes, the profile 20$"):
        Link(STANDARD).encode(bytes(19), bytes(7))
    with pytest.raises(CueError, match=r"^L1 holds 1 bytes, the profile 0$"):
        Link(ROBUST).encode(bytes(ROBUST.l0_bytes), b"x")


def test_what_is_not_accepted_is_unknown() -> None:
    link = Link(STANDARD)
    cut = STANDARD.l0_coded
    coded = link.encode(bytes(range(20)), bytes(7))
    llr = ratios(coded)
    llr[cut:] = np.random.default_rng(3).normal(size=llr.size - cut)
    decoded = link.decode(llr)
    assert (decoded.l0, decoded.l1) == (bytes(range(20)), None)
    np.testing.assert_array_equal(decoded.coded[:cut], coded[:cut])
    assert (decoded.coded[cut:] == -1).all()
    nothing = link.decode(-llr)
    assert (nothing.l0, nothing.l1) == (None, None)
    assert nothing.coded.shape == llr.shape
    assert (nothing.coded == -1).all()
    alone = Link(ROBUST)
    coded = alone.encode(bytes(ROBUST.l0_bytes), b"")
    assert alone.decode(ratios(coded)).l1 == b""


def test_the_longer_list_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight paths unless told otherwise, for both classes."""
    asked: list[int] = []
    decode = _kernels.scl_decode

    def told(llr: Any, frozen: Any, list_size: int, *arguments: Any) -> int:
        asked.append(list_size)
        return int(decode(llr, frozen, list_size, *arguments))

    monkeypatch.setattr(_kernels, "scl_decode", told)
    link = Link(STANDARD)
    llr = ratios(link.encode(bytes(20), bytes(7)))
    link.decode(llr)
    link.decode(llr, list_size=4)
    link.second(llr)
    assert asked == [8, 8, 4, 4, 8]


@pytest.mark.parametrize(("profile", "asked"), [(STANDARD, 64), (HIGH, 16)])
def test_few_paths_are_asked_for_the_short_check(
    profile: AudioProfile, asked: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A check of 16 bits lets one in 65536 wrong paths pass."""
    asked_of: list[int] = []

    def refused(messages: NDArray[np.int64], check: int) -> NDArray[np.bool_]:
        asked_of.append(len(messages))
        return np.zeros(len(messages), dtype=bool)

    link, rng = Link(profile), np.random.default_rng(1)
    coded = link.encode(bytes(profile.l0_bytes), bytes(profile.l1_bytes))
    monkeypatch.setattr("watermark.link.link.passes", refused)
    monkeypatch.setattr(type(link._second), "_least", lambda self, llr: -np.inf)
    assert link.second(0.3 * ratios(coded) + rng.normal(size=coded.size), list_size=512) is None
    assert asked_of == [asked]


def test_codes_that_cannot_be() -> None:
    for message, length, mother in ((0, 16, None), (17, 16, None), (5, 16, 32), (5, 16, 12)):
        with pytest.raises(CueError, match=f"^{message} message bits in a polar code of "):
            make_code(message, length, mother)
    assert make_code(16, 16).frozen.sum() == 0
    assert make_code(1, 31).frozen.tolist() == [1] * 15 + [0]
    assert longest_mother(31) == 16
    assert longest_mother(32) == 32


def test_bits_are_repeated_in_order_and_add() -> None:
    code = make_code(5, 24, 16)
    word = code.encode(np.array([1, 0, 1, 1, 0]))
    np.testing.assert_array_equal(word[16:], word[:8])
    llr = ratios(word)
    llr[:8], llr[16:] = -0.5 * llr[:8], 0.75 * llr[16:]
    found = code.decode(llr, accept=lambda message: True)
    assert found is not None
    assert found.tolist() == [1, 0, 1, 1, 0]
    # The second best is asked for only if the best is not accepted; none if none is.
    tried: list[list[int]] = []

    def refuse(word: NDArray[np.int64]) -> bool:
        tried.append(word.tolist())
        return False

    assert code.decode(llr, accept=refuse, list_size=4) is None
    assert len(tried) == 4
    assert tried[0] == [1, 0, 1, 1, 0]
    assert len({tuple(t) for t in tried}) == 4


def plain_list_decoder(
    llr: NDArray[np.float64], frozen: NDArray[np.int64], list_size: int
) -> list[tuple[float, tuple[int, ...]]]:
    """Every path written out: ratios of a leaf by recursion over the decided bits."""

    def leaf(ratios: NDArray[np.float64], decided: tuple[int, ...]) -> float:
        if ratios.size == 1:
            return float(ratios[0])
        a, b = np.split(ratios, 2)
        half = a.size
        if len(decided) < half:
            return leaf(np.sign(a) * np.sign(b) * np.minimum(abs(a), abs(b)), decided)
        u = np.array(decided[:half])
        _kernels.polar_transform(u)
        return leaf(b + (1 - 2 * u) * a, decided[half:])

    paths: list[tuple[float, tuple[int, ...]]] = [(0.0, ())]
    for stop in frozen:
        grown = []
        for metric, decided in paths:
            ratio = leaf(llr, decided)
            for bit in (0,) if stop else (0, 1):
                cost = abs(ratio) if (ratio < 0) != bool(bit) else 0.0
                grown.append((metric + cost, (*decided, bit)))
        paths = sorted(grown)[:list_size]
    return sorted(paths)


@pytest.mark.parametrize("list_size", [1, 2, 3, 8, 40])
@pytest.mark.parametrize(("message", "size"), [(5, 16), (11, 16), (9, 32), (1, 2)])
def test_the_list_is_that_of_the_written_out_decoder(
    message: int, size: int, list_size: int
) -> None:
    frozen = make_code(message, size).frozen
    for seed in range(6):
        llr = np.random.default_rng(seed).normal(0.3, 1, size)
        words = np.full((list_size, message), -7, dtype=np.int64)
        metrics = np.full(list_size, -7.0)
        count = _kernels.scl_decode(llr, frozen, list_size, np.inf, words, metrics)
        expected = plain_list_decoder(llr, frozen, list_size)
        assert count == len(expected)
        np.testing.assert_allclose(metrics[:count], [metric for metric, _ in expected], rtol=1e-5)
        free = [np.array(bits)[frozen == 0].tolist() for _, bits in expected]
        assert words[:count].tolist() == free
        largest = float(np.median(metrics[:count])) + 1e-6
        likely = sum(metric <= largest for metric in metrics[:count])
        assert _kernels.scl_decode(llr, frozen, list_size, largest, words, metrics) >= likely
        assert words[:likely].tolist() == free[:likely]


def test_corrects_noise_and_erasures() -> None:
    link = Link(STANDARD)
    received = 0
    for seed in range(20):
        l0, l1 = np.random.default_rng(seed).bytes(20), bytes(7)
        llr = noisy(link.encode(l0, l1), 10 ** (-2 / 20), seed)
        llr[np.random.default_rng(seed + 99).random(llr.size) < 0.25] = 0.0
        received += link.decode(llr).l0 == l0
    assert received == 20  # measured: 20 at -3.5 dB too


def test_noise_is_not_accepted() -> None:
    link, rng = Link(STANDARD), np.random.default_rng(0)
    for _ in range(50):
        assert link.decode(rng.standard_normal(STANDARD.data_cells)).l0 is None


def test_crc_detects_each_single_and_double_error() -> None:
    bits = np.random.default_rng(1).integers(0, 2, 60)
    whole = crc_bits(bits, 24)
    for i in range(60):
        for j in range(i + 1):
            damaged = bits.copy()
            damaged[[i, j]] ^= 1
            assert not np.array_equal(crc_bits(damaged, 24), whole)


def test_list_decoder_finds_the_most_likely_word() -> None:
    """With a list as long as the code book the decoder is maximum likelihood."""
    code, rng = make_code(5, 16), np.random.default_rng(2)
    book = [code.encode((m >> np.arange(5)) & 1) for m in range(32)]
    for _ in range(30):
        llr = rng.standard_normal(16)
        best = max(book, key=lambda word: float(((1 - 2 * word) * llr).sum()))
        found = code.decode(llr, accept=lambda message: True, list_size=32)
        assert found is not None
        np.testing.assert_array_equal(code.encode(found), best)


def test_kernels_agree_with_their_python() -> None:
    rng = np.random.default_rng(3)
    llr, frozen = rng.standard_normal(32), make_code(12, 32).frozen
    words = [np.zeros((4, 12), dtype=np.int64) for _ in range(2)]
    metrics = [np.zeros(4) for _ in range(2)]
    decode = getattr(_kernels.scl_decode, "py_func", _kernels.scl_decode)
    assert _kernels.scl_decode(llr, frozen, 4, np.inf, words[0], metrics[0]) == decode(
        llr, frozen, 4, np.inf, words[1], metrics[1]
    )
    np.testing.assert_array_equal(words[0], words[1])
    np.testing.assert_allclose(metrics[0], metrics[1], rtol=1e-5)
    x = rng.integers(0, 2, 16)
    y = x.copy()
    _kernels.polar_transform(x)
    getattr(_kernels.polar_transform, "py_func", _kernels.polar_transform)(y)
    np.testing.assert_array_equal(x, y)


def divided(bits: list[int], width: int, polynomial: int) -> int:
    """The remainder bit by bit, from a register of ones."""
    register = 2**width - 1
    for bit in bits:
        out = register // 2 ** (width - 1) ^ bit
        register = register * 2 % 2**width ^ out * polynomial
    return int(register)


@given(st.lists(st.integers(0, 1), min_size=1, max_size=200))
@settings(max_examples=50, deadline=None)
def test_checks_are_remainders(bits: list[int]) -> None:
    for width, polynomial in ((16, 0x1021), (24, 0x864CFB)):
        found = int("".join(map(str, crc_bits(np.array(bits, dtype=np.int64), width))), 2)
        assert found == divided(bits, width, polynomial)


def accords(one: Any, message: np.ndarray, llr: np.ndarray) -> bool:
    return bool(llr @ (1.0 - 2.0 * one.code.encode(message)) >= one._least(llr))


def accepts(one: Any, message: np.ndarray, llr: np.ndarray) -> bool:
    return bool(one._passes(message[np.newaxis])[0]) and accords(one, message, llr)


@pytest.mark.parametrize(("length", "accepted"), [(1344, False), (300, True)])
def test_noise_that_passes_the_check_is_not_a_message(length: int, accepted: bool) -> None:
    """At low rates the codeword has to stand out of noise; at high rates the check has to do."""
    first = _Class("L0", 12, L0_CHECK, make_code(8 * 12 + L0_CHECK, length))
    assert (first.code.message > SIGNIFICANT_RATE * first.code.length) is accepted
    rng = np.random.default_rng(3)
    for _ in range(8):
        payload = rng.bytes(12)
        coded = first.encode(payload)
        message = np.unpackbits(np.frombuffer(payload, np.uint8)).astype(np.int64)
        message = np.concatenate([message, crc_bits(message, L0_CHECK)])
        assert accepts(first, message, noisy(coded, 1.5, 1))
        noise = rng.normal(size=coded.size)
        assert accepts(first, message, noise) is accepted
        wrong = message.copy()
        wrong[5] ^= 1
        assert not accepts(first, wrong, noisy(coded, 1.5, 1))


@pytest.mark.parametrize(("share", "accepted"), [(1.02, True), (0.92, False)])
def test_how_far_a_message_has_to_stand_out(share: float, accepted: bool) -> None:
    """By 0.97 of what the best of all random codewords reaches with noise."""
    first = Link(ROBUST)._first
    payload = bytes(range(7))
    message = np.unpackbits(np.frombuffer(payload, np.uint8)).astype(np.int64)
    message = np.concatenate([message, crc_bits(message, L0_CHECK)])
    signal = 1.0 - 2.0 * first.encode(payload)
    noise = np.random.default_rng(1).normal(size=signal.size)
    noise -= signal * (noise @ signal) / (signal @ signal)
    length = signal.size
    # Correlation c = a n and energy a^2 n + |noise|^2: the amplitude for a wanted ratio.
    limit = share * np.sqrt(2 * np.log(2) * first.code.message)
    amplitude = np.sqrt(limit**2 * (noise @ noise) / (length**2 - limit**2 * length))
    assert accepts(first, message, amplitude * signal + noise) is accepted


def test_words_of_a_key_s_stream() -> None:
    """Little-endian words of SHAKE-256 of the purpose and the key."""
    raw = hashlib.shake_256(b"cuecast audio 1/signs/18446744073709551615").digest(28)
    words = [int.from_bytes(raw[at : at + 4], "little") for at in range(0, 28, 4)]
    assert stream_words("signs", 2**64 - 1, 7).tolist() == words
    assert stream_words("signs", 2**64 - 1, 3).tolist() == words[:3]
    assert stream_words("signs", 0, 0).tolist() == []
    for key in (-1, 2**64):
        with pytest.raises(CueError, match=rf"^key {key} is not within 0\.\.2\*\*64-1$"):
            stream_words("signs", key, 1)


@dataclass(frozen=True)
class _Values:
    """Rates of `standard` in pictures, few of whose values carry most, or all alike."""

    uneven: bool
    l0_bytes: int = 20
    l1_bytes: int = 140
    l0_coded: int = 2560
    l0_mother: int = 1024
    l1_coded: int = 4320


@pytest.mark.parametrize(("part", "strong", "weak"), [(0.2, 5.0, 0.55), (0.15, 5.0, 0.65)])
def test_few_sure_values_do_not_hide_a_message(part: float, strong: float, weak: float) -> None:
    """Information is 1.4 times the message's; the squares of the sure ones raise the limit."""
    link, read = Link(_Values(uneven=True)), []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        l0, l1 = rng.bytes(20), rng.bytes(140)
        amplitude = np.where(rng.uniform(size=6880) < part, strong, weak)
        sent = ratios(link.encode(l0, l1))
        llr = 2 * amplitude * (amplitude * sent + rng.normal(size=sent.size))
        assert link.second(llr) == l1
        read.append(Link(_Values(uneven=False)).second(llr))
    assert read == [None] * 8


def test_no_path_in_uneven_noise_is_significant(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_Class, "_passes", lambda _, messages: np.ones(len(messages), dtype=bool))
    link = Link(_Values(uneven=True))
    for seed in range(20):
        rng = np.random.default_rng(seed)
        amplitude = np.where(rng.uniform(size=6880) < 0.2, 5.0, 0.55)
        llr = 2 * amplitude * (amplitude * rng.choice([-1.0, 1.0], 6880) + rng.normal(size=6880))
        assert link.decode(llr).l0 is None
        assert link.second(llr) is None
