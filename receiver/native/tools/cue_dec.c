/* cue_dec.c - raw sound on stdin, events as JSON lines on stdout.
 *
 *     cue_dec [--rate HZ] [--channels N] [--format f32|s16] [--key K] [--start S] [--block FRAMES]
 *             [--voice FILE] [--markers] [--no-history] [--time] [--file S.cue]
 *             [--trust PUBLIC.json [--tolerance S] [--utc S]]
 *
 * --utc is the time at which the first sample arrives, seconds since 1970. With --file a stream file is read in place of sound.
 * Samples are in the machine's byte order, channels interleaved. The last line is the diagnosis. Exit: 0 events
 * were found, 1 none, 2 wrong usage, 3 malformed voice or file. A tool of the host's side: it may allocate.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "cuecast.h"

static const char *const states[] = {"searching", "locked", "degraded", "lost", "ended"};

static const char *const statuses[] = {"unknown", "verified", "forged", "unsigned"};

static void print_hex(const char *name, const uint8_t *bytes, int count) {
    if (!count) {
        printf(",\"%s\":null", name);
        return;
    }
    printf(",\"%s\":\"", name);
    for (int i = 0; i < count; i++) printf("%02x", bytes[i]);
    putchar('"');
}

static void print_event(const cue_event *e) {
    printf("{\"time_s\":%.6f,", e->time_s);
    switch (e->kind) {
    case CUE_EVENT_STATE:
        printf("\"kind\":\"state\",\"state\":\"%s\"", states[e->of.state]);
        break;
    case CUE_EVENT_SUPERFRAME: {
        const cue_superframe *s = &e->of.superframe;
        printf("\"kind\":\"superframe\",\"index\":%" PRIu64 ",\"epoch\":%u,\"profile\":%u,"
               "\"start_samples\":%.3f,\"late\":%s,\"confidence\":%.4f,\"error_rate\":%.5f",
               s->index, s->epoch, s->profile, s->start_samples, s->late ? "true" : "false",
               (double)s->confidence, (double)s->error_rate);
        print_hex("l0", s->l0, s->l0_bytes);
        print_hex("l1", s->l1, s->l1_bytes);
        break;
    }
    case CUE_EVENT_LOST:
        printf("\"kind\":\"lost\",\"index\":%" PRIu64 ",\"epoch\":%u,\"count\":%u",
               e->of.lost.index, e->of.lost.epoch, e->of.lost.count);
        break;
    case CUE_EVENT_PHONE:
        printf("\"kind\":\"phone\",\"phone\":%u,\"duration_s\":%.6f,\"final\":%u", e->of.phone.phone,
               e->of.phone.duration_s, e->of.phone.final);
        break;
    case CUE_EVENT_KEY:
    case CUE_EVENT_PREVIEW: {
        const cue_key *k = &e->of.key;
        printf("\"kind\":\"%s\",\"shape\":%u,\"placement\":%u,\"duration_s\":%.6f,\"final\":%u,"
               "\"option\":%u,\"previewed\":%u,\"phones\":[%u,%u],\"revision\":%u",
               e->kind == CUE_EVENT_KEY ? "key" : "preview", k->shape, k->placement, k->duration_s,
               k->final, k->option, k->previewed, k->phones[0], k->phones[1], k->revision);
        break;
    }
    case CUE_EVENT_MOTION:
        printf("\"kind\":\"motion\",\"revision\":%u,\"layers\":%u,\"values\":[",
               e->of.motion.revision, e->of.motion.layers);
        for (uint32_t i = 0; i < e->of.motion.count; i++)
            printf("%s%.6g", i ? "," : "", (double)e->of.motion.values[i]);
        putchar(']');
        break;
    case CUE_EVENT_MARKERS:
        printf("\"kind\":\"markers\",\"revision\":%u,\"place_mm\":[", e->of.markers.revision);
        for (uint32_t i = 0; i < e->of.markers.count; i++)
            printf("%s[%.4f,%.4f,%.4f]", i ? "," : "", (double)e->of.markers.place_mm[i][0],
                   (double)e->of.markers.place_mm[i][1], (double)e->of.markers.place_mm[i][2]);
        putchar(']');
        break;
    case CUE_EVENT_PROOF:
        printf("\"kind\":\"proof\",\"status\":\"%s\",\"reason\":%u,\"age_s\":%.2f",
               statuses[e->of.proof.status & 3], e->of.proof.reason, (double)e->of.proof.age_s);
        break;
    case CUE_EVENT_UNREADABLE:
        printf("\"kind\":\"unreadable\",\"identity\":%u,\"version\":%u", e->of.unreadable.identity,
               e->of.unreadable.version);
        break;
    }
    puts("}");
}

static void print_diagnosis(const cue_state *cue, double processor_s) {
    cue_diagnosis d;
    char text[512];
    d.size = sizeof d;
    if (cue_diagnose(cue, &d) != CUE_OK || cue_explain(cue, text, sizeof text) != CUE_OK) return;
    printf("{\"kind\":\"diagnosis\",\"state\":\"%s\",\"heard_s\":%.3f,\"level_dbfs\":%.1f,"
           "\"pilots\":%.2f,\"clock_ppm\":%.1f,\"gain_db\":%.1f,\"profile\":%u,\"pair\":%u,"
           "\"inverted\":%u,\"mix\":%u,\"first_lock_s\":%.2f,\"superframes\":%u,\"failed\":%u,"
           "\"second_failed\":%u,\"tried\":%u,\"proofs\":%u,\"forged\":%u,\"processor_s\":%.3f,"
           "\"text\":\"",
           states[d.state], d.heard_s, (double)d.level_dbfs[0], (double)d.pilots,
           (double)d.clock_ppm, (double)d.gain_db, d.profile, d.pair, d.inverted, d.mix,
           d.first_lock_s, d.superframes, d.failed, d.second_failed, d.tried, d.proofs, d.forged,
           processor_s);
    for (const char *c = text; *c; c++) {
        if (*c == '"' || *c == '\\') putchar('\\');
        putchar((unsigned char)*c < 32 ? ' ' : *c);
    }
    puts("\"}");
}

static void *read_file(const char *path, size_t *bytes) {
    FILE *file = fopen(path, "rb");
    unsigned char *data = NULL;
    *bytes = 0;
    while (file && !feof(file) && !ferror(file)) {
        unsigned char *more = realloc(data, *bytes + 65536);
        if (!more) break;
        data = more;
        *bytes += fread(data + *bytes, 1, 65536, file);
    }
    if (file) fclose(file);
    return data;
}

static int print_waiting(cue_state *cue) {
    cue_event event = {.size = sizeof event};
    int found = 0;
    while (cue_next(cue, &event) == CUE_OK) {
        found |= event.kind != CUE_EVENT_STATE;
        print_event(&event);
    }
    return found;
}

/* A stream file in place of sound: 0 if it has events, 3 if it is malformed. */
static int read_stream(cue_state *cue, const char *path) {
    size_t bytes;
    char text[512] = "cannot read";
    cue_file_info info = {.size = sizeof info};
    void *file = read_file(path, &bytes);
    int found = 0;
    cue_status status = file ? cue_file_open(cue, file, bytes, &info) : CUE_BAD_DATA;
    if (status == CUE_OK) {
        while ((status = cue_file_read(cue, file, bytes)) == CUE_OK) found |= print_waiting(cue);
        free(file);
        return !found;
    }
    if (file && cue_explain(cue, text, sizeof text) != CUE_OK) return 3;
    fprintf(stderr, "cue_dec: %s: %s\n", path, text);
    free(file);
    return 3;
}

static int usage(const char *what) {
    fprintf(stderr, "cue_dec: %s\n", what);
    return 2;
}

int main(int argc, char **argv) {
    cue_config config = cue_default_config(48000, 2);
    const char *voice = NULL, *stream = NULL, *trusted = NULL;
    double tolerance_s = 10, utc_s = 0, pushed_s = 0;
    size_t block = 4800;
    int words = 0, timed = 0, found = 0;
    for (int i = 1; i < argc; i++) {
        const char *name = argv[i], *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (!strcmp(name, "--markers")) config.markers = 1;
        else if (!strcmp(name, "--no-history")) config.history = 0;
        else if (!strcmp(name, "--time")) timed = 1;
        else if (!value) return usage("an option lacks its value, or is unknown");
        else if (++i, !strcmp(name, "--rate")) config.rate_hz = (uint32_t)strtoul(value, NULL, 10);
        else if (!strcmp(name, "--channels")) config.channels = (uint32_t)strtoul(value, NULL, 10);
        else if (!strcmp(name, "--format")) words = !strcmp(value, "s16");
        else if (!strcmp(name, "--key")) config.key = strtoull(value, NULL, 10);
        else if (!strcmp(name, "--start")) config.start_s = strtod(value, NULL);
        else if (!strcmp(name, "--block")) block = strtoul(value, NULL, 10);
        else if (!strcmp(name, "--voice")) voice = value;
        else if (!strcmp(name, "--file")) stream = value;
        else if (!strcmp(name, "--trust")) trusted = value;
        else if (!strcmp(name, "--tolerance")) tolerance_s = strtod(value, NULL);
        else if (!strcmp(name, "--utc")) utc_s = strtod(value, NULL);
        else return usage("unknown option");
    }
    size_t bytes = cue_size(&config), width = config.channels * (words ? 2 : sizeof(float)), frames;
    if (!bytes || !block) return usage("a rate, channel number or block is outside its limits");
    cue_state *cue = malloc(bytes);
    void *samples = malloc(block * width);
    if (!cue || !samples || cue_init(cue, bytes, &config) != CUE_OK) return usage("no memory");
    if (voice) {
        size_t size;
        void *file = read_file(voice, &size);
        if (!file || cue_voice(cue, file, size) != CUE_OK) {
            fprintf(stderr, "cue_dec: %s is no voice of this version\n", voice);
            return 3;
        }
        free(file);
    }
    if (trusted) {
        char text[512] = "cannot read";
        size_t size;
        void *file = read_file(trusted, &size);
        if (!file || cue_trust(cue, file, size, tolerance_s, NULL, NULL) != CUE_OK) {
            if (file && cue_explain(cue, text, sizeof text) != CUE_OK) return 3;
            fprintf(stderr, "cue_dec: %s: %s\n", trusted, text);
            return 3;
        }
        free(file);
    }
    if (stream) return read_stream(cue, stream);
    clock_t start = clock();
    do {
        frames = fread(samples, width, block, stdin);
        if (utc_s != 0 && cue_clock(cue, utc_s + pushed_s) != CUE_OK) return usage("--utc");
        pushed_s += (double)frames / config.rate_hz;
        cue_status status = !frames ? cue_flush(cue)
                            : words ? cue_push_s16(cue, samples, frames)
                                    : cue_push(cue, samples, frames);
        if (status != CUE_OK) fprintf(stderr, "cue_dec: status %d\n", (int)status);
        found |= print_waiting(cue);
    } while (frames);
    print_diagnosis(cue, timed ? (double)(clock() - start) / CLOCKS_PER_SEC : 0);
    free(samples);
    free(cue);
    return !found;
}
