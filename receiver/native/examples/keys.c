#include "cuecast.h"
#include <stdio.h>
#include <stdlib.h>

static void show(cue_state *cue) {
    cue_event event = {.size = sizeof event};
    while (cue_next(cue, &event) == CUE_OK)
        if (event.kind == CUE_EVENT_KEY && event.of.key.final)
            printf("%.2f s shape %d placement %d\n", event.time_s, event.of.key.shape,
                   event.of.key.placement);
}

int main(int argc, char **argv) {
    static unsigned char voice[300000];
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    size_t frames, bytes = file ? fread(voice, 1, sizeof voice, file) : 0;
    cue_config config = cue_default_config(48000, 2);
    cue_state *cue = malloc(cue_size(&config));
    if (!cue || cue_init(cue, cue_size(&config), &config) != CUE_OK) return 2;
    if (cue_voice(cue, voice, bytes) != CUE_OK) return 3;
    float block[2 * 480];
    while ((frames = fread(block, 2 * sizeof(float), 480, stdin)) > 0) {
        if (cue_push(cue, block, frames) != CUE_OK) return 2;
        show(cue);
    }
    if (cue_flush(cue) != CUE_OK) return 2;
    show(cue);
    free(cue);
    return 0;
}
