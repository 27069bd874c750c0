/* states.c - a state can be copied while it runs; the old block may be overwritten.
 *
 *     states RATE CHANNELS BLOCK < sound.f32
 *
 * Two receivers hear the same sound; one of them moves to another block of memory after every
 * block of samples, and the block that it left is filled with 0xA5. Prints the number of events.
 * Exit 1 if any event differs, 2 if the memory around a block was touched. A failure suggests a
 * pointer inside the state, or a write beyond it.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cuecast.h"

enum { GUARD = 64, MARK = 0x5A, POISON = 0xA5 };

static int intact(const unsigned char *block, size_t bytes) {
    for (size_t i = 0; i < GUARD; i++)
        if (block[i] != MARK || block[GUARD + bytes + i] != MARK) return 0;
    return 1;
}

static unsigned char *make(size_t bytes) {
    unsigned char *block = malloc(bytes + 2 * GUARD);
    if (block) memset(block, MARK, bytes + 2 * GUARD);
    return block;
}

int main(int argc, char **argv) {
    if (argc != 4) return 3;
    cue_config config = cue_default_config((uint32_t)atoi(argv[1]), (uint32_t)atoi(argv[2]));
    size_t bytes = cue_size(&config), block = (size_t)atoi(argv[3]), frames, events = 0;
    unsigned char *still = make(bytes), *moving = make(bytes), *spare = make(bytes);
    float *samples = malloc(block * config.channels * sizeof(float));
    if (!still || !moving || !spare || !samples) return 3;
    if (cue_init(still + GUARD, bytes, &config) != CUE_OK) return 3;
    if (cue_init(moving + GUARD, bytes, &config) != CUE_OK) return 3;
    do {
        cue_state *a = (void *)(still + GUARD), *b = (void *)(moving + GUARD);
        frames = fread(samples, config.channels * sizeof(float), block, stdin);
        if ((frames ? cue_push(a, samples, frames) : cue_flush(a)) != CUE_OK) return 3;
        if ((frames ? cue_push(b, samples, frames) : cue_flush(b)) != CUE_OK) return 3;
        for (;;) {
            cue_event x, y;
            memset(&x, 0, sizeof x);
            memset(&y, 0, sizeof y);
            x.size = y.size = sizeof x;
            cue_status one = cue_next(a, &x), other = cue_next(b, &y);
            if (one != other || memcmp(&x, &y, sizeof x)) return 1;
            if (one != CUE_OK) break;
            events++;
        }
        memcpy(spare + GUARD, moving + GUARD, bytes);
        memset(moving + GUARD, POISON, bytes);
        if (!intact(still, bytes) || !intact(moving, bytes)) return 2;
        unsigned char *swap = moving;
        moving = spare;
        spare = swap;
    } while (frames);
    printf("%zu\n", events);
    free(still);
    free(moving);
    free(spare);
    free(samples);
    return 0;
}
