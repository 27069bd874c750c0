/* arrivals.c - the superframes that are drawn when they come at given times.
 *
 *     arrivals VOICE < lines of a time on air in seconds and L0 in hexadecimal
 *
 * Prints the time of each frame of motion, one a line, after the number of the line that gave it.
 * A failure suggests a superframe that is believed too early, or never.
 */
#include "payload.h"

#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv) {
    static uint8_t voice[300000];
    static char hex[256];
    cue_config config = {.size = sizeof config, .rate_hz = 48000, .channels = 2};
    cue_payload *p = malloc(cue_payload_size(&config));
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : 0;
    size_t bytes = file ? fread(voice, 1, sizeof voice, file) : 0;
    double on_air_s;
    if (!p || cue_payload_init(p, &config) || cue_payload_voice(p, voice, bytes)) return 3;
    for (int line = 0; scanf("%lf %255s", &on_air_s, hex) == 2; line++) {
        uint8_t part[64];
        size_t n = 0;
        unsigned byte;
        cue_rule rule;
        cue_event event = {.size = sizeof event};
        while (n < sizeof part && sscanf(hex + 2 * n, "%2x", &byte) == 1) part[n++] = (uint8_t)byte;
        if (cue_payload_put(p, part, n, 0, 0, on_air_s, &rule) != CUE_OK) return 3;
        while (cue_payload_next(p, &event) == CUE_OK)
            if (event.kind == CUE_EVENT_MOTION) printf("%d %.3f\n", line, event.time_s);
    }
    free(p);
    return 0;
}
