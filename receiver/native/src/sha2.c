/* sha2.c
 * In: bytes, in parts. Out: their SHA-256 or SHA-512.
 * Source: FIPS 180-4, sections 5.3 and 6. The constants of SHA-256 are the upper halves of those of
 * SHA-512: bits of the cube and square roots of the first primes.
 * Specification: spec/authentication.md (E1). */
#include "payload.h"

#include <string.h>

static const uint64_t K[80] = {
    0x428a2f98d728ae22, 0x7137449123ef65cd, 0xb5c0fbcfec4d3b2f, 0xe9b5dba58189dbbc,
    0x3956c25bf348b538, 0x59f111f1b605d019, 0x923f82a4af194f9b, 0xab1c5ed5da6d8118,
    0xd807aa98a3030242, 0x12835b0145706fbe, 0x243185be4ee4b28c, 0x550c7dc3d5ffb4e2,
    0x72be5d74f27b896f, 0x80deb1fe3b1696b1, 0x9bdc06a725c71235, 0xc19bf174cf692694,
    0xe49b69c19ef14ad2, 0xefbe4786384f25e3, 0x0fc19dc68b8cd5b5, 0x240ca1cc77ac9c65,
    0x2de92c6f592b0275, 0x4a7484aa6ea6e483, 0x5cb0a9dcbd41fbd4, 0x76f988da831153b5,
    0x983e5152ee66dfab, 0xa831c66d2db43210, 0xb00327c898fb213f, 0xbf597fc7beef0ee4,
    0xc6e00bf33da88fc2, 0xd5a79147930aa725, 0x06ca6351e003826f, 0x142929670a0e6e70,
    0x27b70a8546d22ffc, 0x2e1b21385c26c926, 0x4d2c6dfc5ac42aed, 0x53380d139d95b3df,
    0x650a73548baf63de, 0x766a0abb3c77b2a8, 0x81c2c92e47edaee6, 0x92722c851482353b,
    0xa2bfe8a14cf10364, 0xa81a664bbc423001, 0xc24b8b70d0f89791, 0xc76c51a30654be30,
    0xd192e819d6ef5218, 0xd69906245565a910, 0xf40e35855771202a, 0x106aa07032bbd1b8,
    0x19a4c116b8d2d0c8, 0x1e376c085141ab53, 0x2748774cdf8eeb99, 0x34b0bcb5e19b48a8,
    0x391c0cb3c5c95a63, 0x4ed8aa4ae3418acb, 0x5b9cca4f7763e373, 0x682e6ff3d6b2b8a3,
    0x748f82ee5defb2fc, 0x78a5636f43172f60, 0x84c87814a1f0ab72, 0x8cc702081a6439ec,
    0x90befffa23631e28, 0xa4506cebde82bde9, 0xbef9a3f7b2c67915, 0xc67178f2e372532b,
    0xca273eceea26619c, 0xd186b8c721c0c207, 0xeada7dd6cde0eb1e, 0xf57d4f7fee6ed178,
    0x06f067aa72176fba, 0x0a637dc5a2c898a6, 0x113f9804bef90dae, 0x1b710b35131c471b,
    0x28db77f523047d84, 0x32caab7b40c72493, 0x3c9ebe0a15c9bebc, 0x431d67c49c100d4c,
    0x4cc5d4becb3e42b6, 0x597f299cfc657e2a, 0x5fcb6fab3ad6faec, 0x6c44198c4a475817};

static const uint64_t BEGIN[8] = {
    0x6a09e667f3bcc908, 0xbb67ae8584caa73b, 0x3c6ef372fe94f82b, 0xa54ff53a5f1d36f1,
    0x510e527fade682d1, 0x9b05688c2b3e6c1f, 0x1f83d9abfb41bd6b, 0x5be0cd19137e2179};

#define TURN(x, n) ((x) >> (n) | (x) << (8 * sizeof(x) - (n)))

/* Both functions are the same but for the word, the rounds and six turns. */
#define BLOCK(NAME, WORD, ROUNDS, A, B, C, D, E, F, G, H, I, J, L, M)                              \
    static void NAME(WORD h[8], const uint8_t *data)                                               \
    {                                                                                              \
        WORD w[ROUNDS], v[8];                                                                      \
        for (size_t i = 0; i < 16; i++) {                                                          \
            w[i] = 0;                                                                              \
            for (size_t b = 0; b < sizeof(WORD); b++)                                              \
                w[i] = (WORD)(w[i] << 8 | data[sizeof(WORD) * i + b]);                             \
        }                                                                                          \
        for (int i = 16; i < ROUNDS; i++) {                                                        \
            WORD x = w[i - 15], y = w[i - 2];                                                      \
            w[i] = w[i - 16] + w[i - 7] + (TURN(x, G) ^ TURN(x, H) ^ x >> I) +                     \
                   (TURN(y, J) ^ TURN(y, L) ^ y >> M);                                             \
        }                                                                                          \
        memcpy(v, h, sizeof v);                                                                    \
        for (int i = 0; i < ROUNDS; i++) {                                                         \
            WORD a = v[0], e = v[4];                                                               \
            WORD one = v[7] + (TURN(e, D) ^ TURN(e, E) ^ TURN(e, F)) + ((e & v[5]) ^ (~e & v[6])) + \
                       (WORD)(K[i] >> (64 - 8 * sizeof(WORD))) + w[i];                             \
            WORD two = (TURN(a, A) ^ TURN(a, B) ^ TURN(a, C)) +                                    \
                       ((a & v[1]) ^ (a & v[2]) ^ (v[1] & v[2]));                                  \
            v[7] = v[6], v[6] = v[5], v[5] = e, v[4] = v[3] + one;                                 \
            v[3] = v[2], v[2] = v[1], v[1] = a, v[0] = one + two;                                  \
        }                                                                                          \
        for (int i = 0; i < 8; i++) h[i] += v[i];                                                  \
    }

BLOCK(take256, uint32_t, 64, 2, 13, 22, 6, 11, 25, 7, 18, 3, 17, 19, 10)
BLOCK(take512, uint64_t, 80, 28, 34, 39, 14, 18, 41, 1, 8, 7, 19, 61, 6)

void cue_sha512_begin(cue_sha512 *s) {
    memcpy(s->h, BEGIN, sizeof s->h);
    s->bytes = 0;
}

void cue_sha512_add(cue_sha512 *s, const uint8_t *data, size_t bytes) {
    for (size_t i = 0; i < bytes; i++) {
        s->block[s->bytes++ % 128] = data[i];
        if (s->bytes % 128 == 0) take512(s->h, s->block);
    }
}

void cue_sha512_end(cue_sha512 *s, uint8_t digest[64]) {
    static const uint8_t one = 0x80, zero = 0;
    uint8_t length[8];
    for (int i = 0; i < 8; i++) length[i] = (uint8_t)(8 * s->bytes >> (56 - 8 * i));
    cue_sha512_add(s, &one, 1);
    while (s->bytes % 128 != 120) cue_sha512_add(s, &zero, 1);
    cue_sha512_add(s, length, 8);
    for (int i = 0; i < 64; i++) digest[i] = (uint8_t)(s->h[i / 8] >> (56 - 8 * (i % 8)));
}

void cue_sha256(const uint8_t *data, size_t bytes, uint8_t digest[32]) {
    uint32_t h[8];
    uint8_t last[128] = {0};
    size_t whole = bytes / 64 * 64, rest = bytes - whole, end = rest < 56 ? 64 : 128;
    for (int i = 0; i < 8; i++) h[i] = (uint32_t)(BEGIN[i] >> 32);
    for (size_t at = 0; at < whole; at += 64) take256(h, data + at);
    if (rest) memcpy(last, data + whole, rest);
    last[rest] = 0x80;
    for (size_t i = 0; i < 8; i++) last[end - 1 - i] = (uint8_t)((uint64_t)bytes * 8 >> 8 * i);
    for (size_t at = 0; at < end; at += 64) take256(h, last + at);
    for (size_t i = 0; i < 32; i++) digest[i] = (uint8_t)(h[i / 4] >> (24 - 8 * (i % 4)));
}
