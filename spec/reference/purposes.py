"""Why each vector exists, and where to look when a decoder fails it: by families of identifiers.

Case identifiers go in, `purpose` and `failure_suggests` come out. The first pattern that matches a
whole identifier applies.
"""

import re

Rows = tuple[tuple[str, str, str], ...]

SUPERFRAME: Rows = (
    ("score-of-zeros", "a score and a preview from a payload of zeros, worked by hand in "
     "implementing.md", "range decoder, order of the score's symbols (H8, S3 to S6)"),
    ("step-63-all-ones", "step 63: neither setting nor coefficients are read, L1 is ignored",
     "fields of the setting read although the step is 63 (H8, H10)"),
    ("random-mode-0-.*", "a whole superframe of mode 0, random bytes, L1 of growing length",
     "order of the fields of H8 in mode 0, or where L1 continues (C5)"),
    ("random-mode-1-.*", "a whole superframe of mode 1, random bytes, L1 of growing length",
     "order of the fields of H8 in mode 1, or where L1 continues (C5)"),
    ("even-.*", "phones at even distances",
     "phone i starts at 32 i // n, the first ends at 0: S8"),
    ("special-vowel-1-.*", "replaced keys behind a consonant and vowel 1 (a), the lowest vowel",
     "borders of vowels 1..16 in the rule which phones start keys (S10)"),
    ("special-vowel-16-.*", "replaced keys behind vowel 16 and another vowel",
     "borders of vowels 1..16 in the rule which phones start keys (S10)"),
    ("special-.*", "options of the cheek, the silence, and replaced keys",
     "order of the options, equal symbols of table 2, which phones start keys (S9, S10)"),
    ("large-indices-.*", "fine steps: indices with many low bits", "shift and low bits (C1, C4)"),
    ("escape-deep", "an escape of 20 bits, whose closing 0 is absent", "limit of u in C4"),
    ("escape-.*", "magnitudes of 15 and more", "escape code: u ones, a zero, u bits (C4)"),
    ("basis-.*", "each basis in both modes", "table of the basis by mode and use; order of "
     "coefficients by the basis's own scales (H8, T2, Q6)"),
    ("level-6-fine-.*", "level 6 (scales lowered by 12) at fine steps",
     "levels applied to scales before classes (C1, Q6)"),
    ("level-.*", "each raise of the scales", "list of levels 0, 4, -4, 8, -8, 12, -12 (Q6)"),
    ("course-.*", "each course of strokes", "table or place of the course in H8"),
    ("shift-.*", "each shift of the hand in time", "table or place of the shift in H8"),
    ("shares-.*", "use 2: a share for each part", "order face, hand, head, forearm (H8, P10)"),
    ("preview-.*", "each choice of previewed superframes",
     "table of V1; gaps by cells, the extra bit in the preview at distance 2 alone (V2)"),
    ("slow-.*", "one to three pieces of the slow channel before the payload", "pieces of 16 bits "
     "come first, before the step (H8, V4)"),
    ("signed-.*", "9 bits of proof behind a payload that ends within a byte",
     "bits of the last byte that are not payload: zeros in code, ones in slack (R8); where the "
     "proof lies (H12)"),
    ("l1-of-another-l0", "an L1 whose check belongs to another L0 is left out",
     "L1's check starts from L0's check (H7)"),
    ("l1-continues-.*", "coefficients that L0 does not determine come from L1",
     "determined symbols (R6), all symbols of one coefficient together (C5)"),
    ("l1-short-.*", "L1 of one to four bytes behind a short L0", "end of L1's code (C5, R6)"),
    ("compact-zeros-.*", "compact payload of zeros", "begin, pace, timing of a window (M1 to M4)"),
    ("compact-ones-.*", "compact payload of ones", "last symbols of all rows (M1 to M6)"),
    ("compact-signed-.*", "2 bits of proof in a compact superframe",
     "payload ends 4 bits before the end (R8, H12); identity above the proof (M2)"),
    ("compact-slow-.*", "a piece of the slow channel in a compact superframe",
     "the symbol before it, of table [32512, 256] (M1)"),
    ("compact-pause-first", "a window that begins with a pause", "the pause's length is the unit; "
     "none is coded (M7)"),
    ("compact-silent", "a window without phones", "pauses at the end are dropped (M5)"),
    ("compact-special", "options in a compact superframe", "no replaced keys in windows (M1, S9)"),
    ("compact-length-32", "a phone of 32 ticks, the limit's symbol", "limit 31 of lengths (M6)"),
    ("compact-rounded", "lengths by pace whose half is rounded up",
     "(usual p + 64) >> 7 (M6)"),
    ("compact-random-.*|compact-more-.*", "random windows of every size, both timings",
     "end of a window: the first symbol that is not determined (M5, R6); lengths (M6)"),
    ("last-vowel-16", "the last vowel as the last phone of a superframe",
     "a look-ahead read after vowel 16 although it is no consonant (S7)"),
    ("key-41", "symbol 41 of a preview, which counts as 40", "V2"),
    ("correction-.*", "each correction of a vowel's length", "list of corrections (M6)"),
    ("last-symbols-.*", "the last symbol of every row at the borders of classes",
     "shift and class at their borders (C1), largest indices (C4)"),
    ("filmed-lists-.*", "labels of a filmed superframe and of others, each choice of lists",
     "which lists follow (V6); cells of four ticks, rows of the gap, no bit for the tick (V7)"),
    ("filmed-basis-.*", "tables of the setting of filmed superframes",
     "the basis has one table in both modes and for every use (H13)"),
    ("filmed-step-.*", "each eighth of the steps", "step of filmed superframes (H13, H10)"),
    ("filmed-shares", "use 2 of a filmed superframe", "table of the use (H13); shares as H8 says"),
    ("filmed-signed-.*", "filmed superframes with proof and pieces of the slow channel",
     "pieces come before the step, whatever its table (H8, H13)"),
    ("filmed-key-41", "symbol 41 of a list, which counts as 40", "V2, V7"),
    ("too-short|signed-too-short|signed-still-too-short|compact-too-short|compact-too-long",
     "a part of an impossible length", "least lengths: 5, signed 7, compact 4..12 (H1)"),
    ("version-.*|compact-version-.*", "another version", "the version's code is compared with 0 "
     "after the check (H2)"),
    ("wrong-check|check-without-identity", "a damaged check; a check without the identity",
     "CRC-16 exclusive-or the first 16 bits of the identity (H5, H6)"),
    ("compact-of-another", "a compact part of another coding", "which two bits of the identity a "
     "sequence number has (M2)"),
)  # fmt: skip

STREAM: Rows = (
    ("spoken-.*", "a line of phones from random bytes", "lengths of F9, contexts of F10"),
    ("keyed-.*", "a line of keys from random bytes", "choices and weights of F11, silences of F12"),
    ("drawn-without-score", "markers of a file without score: transform and voice alone",
     "inverse transform (T1), values (Q1 to Q6), markers (O6 to O9)"),
    ("drawn-fixed", "markers of a file whose prediction does not learn", "prediction (P1 to P10)"),
    ("drawn-learning.*", "markers of a file whose prediction learns", "corrections C, D (F13)"),
    ("drawn-more-.*", "markers with all shifts of the hand", "P9; F13 for the last two cases"),
    ("drawn-constant-.*", "superframes of constant size in mode 0 or 1", "joining of neighbours "
     "(J1 to J4); mode 1 draws the mean and the residual (P8)"),
    ("drawn-filmed-.*", "filmed superframes, all or in part, with scores, without and lost",
     "labels as previews (V8, J8), blended borders of filmed neighbours alone (Q7)"),
    ("drawn-joined-.*", "superframes that continue one another's phones",
     "J1: the last phone of one is the first of the next; consonants alone (J4)"),
    ("drawn-last-phone", "the phone of number 37", "38 phones, 0..37 (G4)"),
    ("drawn-rest-12", "a silence of 12 ticks under the option of 12 ticks: the hand rests",
     "0.25 s taken for 12.5 or 13 ticks instead of 12 (S9, P2)"),
    ("drawn-rest-25", "a silence of exactly 25 ticks: the hand rests", "at least, not more than, "
     "the silence of S9 (P2, P3)"),
    ("other-movement-.*", "another voice's constants of movement, undershoot among them; with "
     "`stroke` 0 in odd cases", "P1 to P6 where the built-in voice's constants are 0 or far from "
     "a border; f is 1 if `stroke` is 0 (P5)"),
    ("drawn-number-.*", "a random file that shows a misreading of sections 4 and 5 which no other "
     "case shows: losses and previews, or another voice's movement",
     "J2 to J8 if superframes are constant, P1 to P7 otherwise"),
    ("ends-in-pause|ends-in-time|one-silence|ends-in-time-keyed|silence-to-the-end",
     "how a line ends", "a pause at the end `e` ends the line; silence 0 lasts to it (F10, F12)"),
    ("special-.*", "replaced keys behind phones at the borders of vowels and consonants",
     "which phones start keys (S10), read over the whole line (F10)"),
    ("neither-phone", "a key of shape 5 at the side without phones", "counts as phone 17 (F11)"),
    ("code-just-long-enough", "a line read 8 bytes beyond its code, which is allowed",
     "refused at 8 bytes instead of more than 8 (F10)"),
    ("code-just-too-short", "a line read 9 bytes beyond its code", "F10"),
    ("one-tick", "the latest first tick, one tick", "limits of F5 include their ends"),
    ("long-record", "a record of 300 bytes", "length 255 is followed by 24 bits (F7)"),
    ("constant|head-alone|constant-cut", "superframes of constant size, whole and cut", "F6"),
    ("short|magic|version-5|head|no-ticks|too-late|too-long", "a malformed head",
     "order and limits of F1 to F5"),
    ("check", "a wrong CRC-32 at the end", "F7"),
    ("no-record|record-too-many|cut-record", "too few records, too many, or one cut", "F6, F7"),
    ("endless", "a line of a day from one byte: refused early", "F10; a decoder that runs on"),
)  # fmt: skip

RECEPTION: Rows = (
    ("lost-.*", "keys of a line of which superframes were lost, previews among them",
     "keys that J5 leaves open; nearest preview (V3), stand-ins and what follows them (J8)"),
    ("windows-.*", "keys and markers of compact superframes, some of them lost",
     "silences, squeezing and holes between windows (J6, J7); options of the nearest (J4); four "
     "windows before and one behind predict (section 5)"),
    ("lips-.*", "markers with the lips as they are shown",
     "weights of phones (K1), rivals (K3), the two moves one after the other (K4, K5)"),
)  # fmt: skip

TABLES = {"superframe": SUPERFRAME, "stream": STREAM, "reception": RECEPTION}


def described(document: str, case: str) -> dict[str, str]:
    """Return `purpose` and `failure_suggests` of a case.

    Raises
    ------
    LookupError
        If no family has the identifier.
    """
    for pattern, purpose, suggests in TABLES[document]:
        if re.fullmatch(pattern, case):
            return {"purpose": purpose, "failure_suggests": suggests}
    raise LookupError(f"no purpose for {case} of {document}")
