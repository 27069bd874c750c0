/* poison.c - a state is copied after each superframe and the old one overwritten.
 *
 *     poison VOICE < lines of hexadecimal L0
 *
 * Purpose: the block holds no pointers, so that its copy goes on as if nothing had happened.
 * Prints the events of a plain run and of a poisoned one; both must be the same.
 * A failure suggests a pointer that is kept in the state, or data outside of it. */
#include "payload.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t run(const uint8_t *voice, size_t bytes, uint8_t parts[][64], const size_t *sizes,
                    int count, int poisons, long *events) {
    cue_config config = {.size = sizeof config, .rate_hz = 48000, .channels = 2, .markers = 1};
    size_t size = cue_payload_size(&config);
    cue_payload *p = malloc(size);
    uint64_t hash = 1469598103934665603U;
    *events = 0;
    if (!p || cue_payload_init(p, &config) || cue_payload_voice(p, voice, bytes)) exit(3);
    for (int i = 0; i < count; i++) {
        cue_rule rule;
        cue_event event = {.size = sizeof event};
        cue_payload_put(p, parts[i], sizes[i], 0, 0, 0.64 * i, &rule);
        for (int k = 0; k < 40 && cue_payload_next(p, &event) == CUE_OK; k++) {
            const uint8_t *data = (const uint8_t *)&event.of;
            ++*events;
            for (size_t b = 0; b < sizeof event.of; b++) hash = (hash ^ data[b]) * 1099511628211U;
        }
        if (poisons) {
            cue_payload *copy = malloc(size);
            if (!copy) exit(3);
            memcpy(copy, p, size);
            memset(p, 0xA5, size);
            free(p);
            p = copy;
        }
    }
    free(p);
    return hash;
}

int main(int argc, char **argv) {
    static uint8_t voice[300000], parts[256][64];
    static char line[256];
    size_t sizes[256];
    int count = 0;
    long plain_events, poisoned_events;
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : 0;
    size_t bytes = file ? fread(voice, 1, sizeof voice, file) : 0;
    while (count < 256 && fgets(line, sizeof line, stdin)) {
        size_t n = 0;
        unsigned byte;
        while (n < 64 && sscanf(line + 2 * n, "%2x", &byte) == 1) parts[count][n++] = (uint8_t)byte;
        sizes[count++] = n;
    }
    uint64_t plain = run(voice, bytes, parts, sizes, count, 0, &plain_events);
    uint64_t poisoned = run(voice, bytes, parts, sizes, count, 1, &poisoned_events);
    printf("{\"superframes\":%d,\"events\":%ld,\"same\":%s}\n", count, plain_events,
           plain == poisoned && plain_events == poisoned_events ? "true" : "false");
    return plain != poisoned;
}
