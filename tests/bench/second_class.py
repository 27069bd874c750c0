"""How often the second class is accepted wrongly where it fails beside a right first one.

For each strength of a known codeword in white noise: superframes whose second class is read
rightly, not at all, and wrongly, by the list that is used where a superframe is due.
``python tests/bench/second_class.py --profile high``
"""

import argparse

import numpy as np

from watermark.audio.follow.retries import LONGEST_LIST_SIZE
from watermark.audio.signal.profile import PROFILES, find_profile
from watermark.link.link import Link


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--profile", choices=PROFILES, default="high")
    parser.add_argument("--superframes", type=int, default=600, help="of each strength")
    parser.add_argument("--strengths", type=float, nargs="+", default=[0.34, 0.38, 0.42])
    parser.add_argument("--seed", type=int, default=5)
    chosen = parser.parse_args()
    profile = find_profile(chosen.profile)
    link, rng = Link(profile), np.random.default_rng(chosen.seed)
    for strength in chosen.strengths:
        right = wrong = 0
        for _ in range(chosen.superframes):
            l0, l1 = rng.bytes(profile.l0_bytes), rng.bytes(profile.l1_bytes)
            sent = 1.0 - 2.0 * link.encode(l0, l1)
            heard = 2 * strength * (strength * sent + rng.normal(size=sent.size))
            found = link.second(heard, list_size=LONGEST_LIST_SIZE)
            right += found == l1
            wrong += found not in (None, l1)
        missed = chosen.superframes - right - wrong
        print(f"{profile.name} {strength:.2f}: right {right}, not read {missed}, wrong {wrong}")


if __name__ == "__main__":
    main()
