/* fuzz.c - random and mutated superframes and voice files into the payload half.
 *
 *     fuzz COUNT SEED VOICE
 *
 * Purpose: no input makes it read or write out of bounds, divide by zero or overflow (sanitizers).
 * A failure suggests a length or an index that is taken from the bits without a limit. */
#include "payload.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t seed;

static uint32_t draw(uint32_t below)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return (uint32_t)(seed >> 32) % below;
}

/* A superframe whose checks are right, so that everything behind them is reached. */
static size_t make(const cue_payload *p, uint8_t *l0, unsigned sequence)
{
    size_t n = 5 + draw(40);
    for (size_t i = 0; i < n; i++) l0[i] = (uint8_t)draw(256);
    if (draw(3) == 0) { /* compact */
        n = 4 + draw(9);
        unsigned is_signed = draw(2);
        l0[0] = (uint8_t)(0x20 | is_signed << 4 | sequence % 16);
        unsigned told = p->bases.identity >> (14 - 2 * (sequence % 8)) & 3U;
        l0[n - 1] = (uint8_t)((l0[n - 1] & ~(3U << 2 * is_signed)) | told << 2 * is_signed);
        return n;
    }
    l0[0] = (uint8_t)(draw(2) << 4 | sequence % 64 >> 2);
    l0[1] = (uint8_t)((sequence & 3) << 6 | draw(64));
    if (draw(4) == 0) memset(l0 + 3, draw(2) ? 0 : 255, n - 5);
    unsigned check = cue_check_of(l0, n - 2, 16, 0x1021, 0xFFFF) ^ p->bases.identity;
    l0[n - 2] = (uint8_t)(check >> 8);
    l0[n - 1] = (uint8_t)check;
    return n;
}

static void spoil(uint8_t *data, size_t n)
{
    for (unsigned i = draw(4); i > 0; i--) data[draw((uint32_t)n)] ^= (uint8_t)(1U << draw(8));
}

static void fuzz_voice(cue_payload *p, const uint8_t *voice, size_t bytes, uint8_t *copy)
{
    size_t n = draw(3) ? bytes : draw((uint32_t)bytes + 1);
    if (n < 72) n = 72;
    memcpy(copy, voice, bytes);
    for (unsigned i = draw(40); i > 0; i--) copy[draw((uint32_t)n)] = (uint8_t)draw(256);
    for (size_t i = 0; i < 4; i++) copy[32 + i] = (uint8_t)(n >> 8 * i);
    cue_sha256(copy, n - 32, copy + n - 32);
    (void)cue_payload_voice(p, copy, n);
}

int main(int argc, char **argv)
{
    static uint8_t voice[300000], copy[300000], l0[64], l1[64];
    if (argc != 4) return 2;
    FILE *file = fopen(argv[3], "rb");
    size_t bytes = file ? fread(voice, 1, sizeof voice, file) : 0, events = 0, drawn = 0;
    cue_config config = {.size = sizeof config, .rate_hz = 48000, .channels = 2, .markers = 1};
    cue_payload *p = malloc(cue_payload_size(&config));
    static cue_content content;
    static cue_coefficients found;
    cue_event event = {.size = sizeof event};
    long count = strtol(argv[1], 0, 10), place = 0;
    seed = strtoull(argv[2], 0, 10) * 2654435761U + 88172645463325252U;
    if (!p || cue_payload_init(p, &config) || cue_payload_voice(p, voice, bytes)) return 3;
    for (long i = 0; i < count; i++) {
        cue_rule rule;
        size_t n0 = make(p, l0, (unsigned)place), n1 = draw(2) ? draw(40) : 0;
        for (size_t k = 0; k < n1; k++) l1[k] = (uint8_t)draw(256);
        if (n1 && n0 >= 5) { /* an L1 that fits, so that it is read */
            unsigned crc = cue_check_of(l0 + n0 - 2, 2, 8, 0x2F, 0xFF);
            l1[n1 - 1] = (uint8_t)(cue_check_of(l1, n1 - 1, 8, 0x2F, crc) ^ 0xFF);
        }
        if (draw(8) == 0) spoil(l0, n0);
        if (draw(20) == 0) n0 = draw((uint32_t)n0);
        if (i % 16) { /* reading alone is fast */
            (void)cue_superframe_read(l0, n0, l1, n1, &p->tables, &p->bases, &content, &found);
            continue;
        }
        long at = place + (draw(6) ? 0 : (long)draw(14) - 7);
        cue_payload_put(p, l0, n0, l1, n1, 0.64 * (double)at + 1e-3 * draw(9), &rule);
        cue_payload_advance(p, 0.64 * (double)(at + (long)draw(9)));
        if (draw(4)) /* else nobody collects */
            while (cue_payload_next(p, &event) == CUE_OK) events++;
        if (cue_payload_draw(p, p->last - (int32_t)draw(8), (int)draw(2))) drawn++;
        place += draw(30) ? 1 : (long)draw(90);
        if (draw(60) == 0) cue_payload_flush(p);
        if (draw(400) == 0) { /* a broken voice, then the good one */
            fuzz_voice(p, voice, bytes, copy);
            cue_payload_put(p, l0, n0, l1, n1, 0.64 * (double)place, &rule);
            while (cue_payload_next(p, &event) == CUE_OK) events++;
            if (cue_payload_voice(p, voice, bytes)) return 4;
        }
    }
    printf("{\"superframes\":%ld,\"events\":%zu,\"drawn\":%zu}\n", count, events, drawn);
    free(p);
    return 0;
}
