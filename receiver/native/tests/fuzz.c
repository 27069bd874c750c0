/* fuzz.c - random and mutated superframes, stream files, announcements and voice files into the
 * payload half.
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

static uint32_t draw(uint32_t below) {
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return (uint32_t)(seed >> 32) % below;
}

/* A superframe whose checks are right, so that everything behind them is reached. */
static size_t make(const cue_payload *p, uint8_t *l0, unsigned sequence) {
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

static void spoil(uint8_t *data, size_t n) {
    for (unsigned i = draw(4); i > 0; i--) data[draw((uint32_t)n)] ^= (uint8_t)(1U << draw(8));
}

static void fuzz_voice(cue_payload *p, const uint8_t *voice, size_t bytes, uint8_t *copy) {
    size_t n = draw(3) ? bytes : draw((uint32_t)bytes + 1);
    if (n < 72) n = 72;
    memcpy(copy, voice, bytes);
    for (unsigned i = draw(40); i > 0; i--) copy[draw((uint32_t)n)] = (uint8_t)draw(256);
    for (size_t i = 0; i < 4; i++) copy[32 + i] = (uint8_t)(n >> 8 * i);
    cue_sha256(copy, n - 32, copy + n - 32);
    (void)cue_payload_voice(p, copy, n);
}

static uint32_t crc32_of(const uint8_t *data, size_t bytes) {
    uint32_t crc = UINT32_MAX;
    for (size_t i = 0; i < bytes; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1U ? 0xEDB88320U : 0U);
    }
    return ~crc;
}

static void put_number(uint8_t *at, uint32_t value, int bytes) {
    while (bytes-- > 0) *at++ = (uint8_t)(value >> 8 * bytes);
}

/* A stream file whose checks are right, mostly with random records; read to its end, or changed. */
static size_t fuzz_file(cue_payload *p) {
    static uint8_t file[4096];
    cue_event event = {.size = sizeof event};
    size_t events = 0, n = 26;
    uint32_t ticks = 1 + draw(200), first = draw(3) ? draw(100) : draw(4320000);
    uint32_t count = (first + ticks + 31) / 32 - first / 32, l0 = draw(4) ? 0 : 5 + draw(20);
    memcpy(file, "CUES\4", 5);
    memcpy(file + 5, p->model.coding, 8);
    put_number(file + 13, first, 4);
    put_number(file + 17, ticks, 4);
    put_number(file + 21, l0 << 12 | (l0 ? draw(20) : 0), 3);
    put_number(file + 24, cue_check_of(file, 24, 16, 0x1021, 0xFFFF), 2);
    if (l0) {
        size_t size = l0 + (file[23] | (file[22] & 15U) << 8);
        for (uint32_t i = 0; i < count; i++, n += size)
            for (size_t k = make(p, file + n, i); k < size; k++) file[n + k] = (uint8_t)draw(256);
    } else {
        for (uint32_t i = 0; i <= count; i++) {
            uint32_t size = draw(8) ? draw(60) : 0;
            file[n++] = (uint8_t)size;
            while (size-- > 0) file[n++] = (uint8_t)draw(256);
        }
        put_number(file + n, crc32_of(file, n), 4);
        n += 4;
    }
    cue_file_info info = {.size = sizeof info};
    if (cue_payload_open(p, file, n, &info) != CUE_OK) return 0;
    for (int i = 0; i < 40 && cue_payload_file_next(p, file, n) == CUE_OK; i++) {
        if (draw(20) == 0) spoil(file + 26, n - 26); /* the caller broke the rule */
        while (cue_payload_next(p, &event) == CUE_OK) events++;
    }
    (void)cue_payload_reset(p);
    return events;
}

static void fuzz_announcement(cue_payload *p) {
    static const char good[] =
        "{\"format\": \"cuecast-key-3\", \"kind\": \"public\", \"name\": \"T\\u00e9l\xc3\xa9\", \"ends\": "
        "{\"9\": \"xaM/iSuer3g=\", \"2\": \"U+nHsEGcnjI=\"}, \"public_key\": \"aWUBjGP5DSZjsX5X8fk5WuCittbm"
        "XkYxKUfa74pBS8A=\", \"first\": 41472000, \"until\": 41607000, \"signature\": \"GPzBeESFgDVmXu2f9"
        "/jO/wesuimWEjXdzxlvGF5HGmEinaMp0SXIR1jFmIWjNerwLMiGRWm/I7js05Qwjwq9DA==\"}";
    uint8_t text[sizeof good];
    memcpy(text, good, sizeof good);
    if (draw(4)) spoil(text, sizeof good - 1);
    size_t n = draw(4) ? sizeof good - 1 : draw(sizeof good);
    (void)cue_payload_trust(p, text, n, 10.0, 0, 0);
}

int main(int argc, char **argv) {
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
        if (draw(10) == 0) events += fuzz_file(p);
        if (draw(40) == 0) fuzz_announcement(p);
        if (draw(100) == 0) { /* proofs are tried with 65536 hashes each: few of them */
            cue_payload_clock(p, 0.64 * (double)place, 1767225600.0 + 0.64 * 41472000.0);
            for (int k = 0; k < 40; k++) {
                l0[0] ^= (uint8_t)draw(2);
                cue_proofs_take(&p->proofs, l0, n0, 0.64 * (double)(place + k));
            }
            (void)cue_payload_trust(p, 0, 0, 0.0, 0, 0);
        }
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
