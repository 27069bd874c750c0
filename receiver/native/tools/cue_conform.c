/* cue_conform.c - a decoder for `cuecast conform`: one JSON object a line in, one a line out.
 *
 * The protocol is in docs/reference/conformance.md. Requests are flat objects without blanks around
 * colons; this program looks fields up by name and is no JSON parser.
 * Build: as tools/cue_dec.c, by build.py.
 */
#include "payload.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_LINE_BYTES = 1 << 22, MOST_BYTES = 1 << 20 };

static char line[MOST_LINE_BYTES];
static uint8_t first_bytes[MOST_BYTES], second_bytes[MOST_BYTES];
static cue_payload *payload; /* the decoder under test, in one block */
static cue_bases bases;      /* of the vectors, which have none of a voice */
static cue_content content;
static cue_coefficients found;
static int32_t shift; /* numbers of the timeline less those of the requests */

static const char *field(const char *name) {
    char wanted[64];
    snprintf(wanted, sizeof wanted, "\"%s\":", name);
    const char *at = strstr(line, wanted);
    return at ? at + strlen(wanted) : 0;
}

static long long number(const char *name, long long otherwise) {
    const char *at = field(name);
    return at ? strtoll(at, 0, 10) : otherwise;
}

static int nibble(int c) {
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* Bytes of a field in hexadecimal; 0 if it is absent or empty. */
static size_t hex(const char *name, uint8_t *out) {
    const char *at = field(name);
    size_t n = 0;
    if (!at || *at++ != '"') return 0;
    for (; n < MOST_BYTES && nibble(at[0]) >= 0 && nibble(at[1]) >= 0; at += 2)
        out[n++] = (uint8_t)(nibble(at[0]) << 4 | nibble(at[1]));
    return n;
}

static size_t text(const char *name, char *out, size_t bytes) {
    const char *at = field(name);
    size_t n = 0;
    if (at && *at++ == '"')
        while (*at && *at != '"' && n + 1 < bytes) out[n++] = *at++;
    out[n] = 0;
    return n;
}

static void print_score(const cue_score *s) {
    printf(",\"score\":");
    if (!s->kind || s->kind == 3) {
        printf("null");
        return;
    }
    printf("{\"cheek\":[%d,%d,%d],\"rest_gap\":%d", s->cheek[0], s->cheek[1], s->cheek[2],
           s->rest_gap);
    if (s->kind == 2)
        printf(",\"begin\":%d,\"end\":%d", s->first_end, s->end);
    else
        printf(",\"first\":%d,\"first_end\":%d,\"ahead\":%d", s->first, s->first_end, s->ahead);
    printf(",\"numbers\":[");
    for (int i = 0; i < s->count; i++) printf("%s%d", i ? "," : "", s->number[i]);
    printf("],\"starts\":[");
    for (int i = 0; i < s->count; i++) printf("%s%d", i ? "," : "", s->start[i]);
    printf("]");
    if (s->kind == 1) {
        const char *between = "";
        printf(",\"overrides\":{");
        for (int t = 0; t < TICKS; t++)
            if (s->replaced[t]) {
                printf("%s\"%d\":[%d,%d]", between, t, (s->replaced[t] - 1) / PLACEMENTS,
                       (s->replaced[t] - 1) % PLACEMENTS);
                between = ",";
            }
        printf("}");
    }
    printf("}");
}

static void print_sparse(const char *name, const int64_t *values) {
    const char *between = "";
    printf(",\"%s\":{", name);
    for (int i = 0; i < found.count; i++)
        if (values[i]) {
            printf("%s\"%d\":%lld", between, i, (long long)values[i]);
            between = ",";
        }
    printf("}");
}

static void print_content(void) {
    const cue_content *c = &content;
    printf("{\"valid\":true,\"header\":[%d,%d,%d,%d,%d],\"slow\":[", c->mode, c->sequence, c->lead,
           c->is_signed, c->proof);
    for (int i = 0; i < c->slow_count; i++) printf("%s%d", i ? "," : "", c->slow[i]);
    printf("],\"setting\":[%d,%d,%d,%d,%d,%d,%d,%d,%d]", c->step, c->basis, c->level, c->course,
           c->shift, c->shares[0], c->shares[1], c->shares[2], c->shares[3]);
    print_score(&c->score);
    const char *between = "";
    printf(",\"previews\":{");
    for (int d = -1; d < 4; d++) {
        const cue_preview *list = d < 0 ? &c->own : &c->preview[d];
        if (d < 0 ? c->mode || !c->filmed : !(c->previews >> d & 1)) continue;
        printf("%s\"%d\":[", between, d == 3 ? -1 : 2 * d + 2);
        for (int i = 0; i < list->count; i++)
            printf("%s[%d,%d]", i ? "," : "", list->tick[i], list->symbol[i]);
        printf("]");
        between = ",";
    }
    printf("}");
    print_sparse("indices", found.index);
    print_sparse("values", found.value);
    printf("}\n");
}

static int load_voice(void) {
    static uint8_t file[1 << 20];
    char path[1024];
    text("binary", path, sizeof path);
    FILE *in = fopen(path, "rb");
    if (!in) return 0;
    size_t n = fread(file, 1, sizeof file, in);
    fclose(in);
    return cue_payload_voice(payload, file, n) == CUE_OK;
}

static void do_bases(void) {
    uint8_t identity[8];
    const char *at = field("scales");
    hex("identity", identity);
    bases.identity = (uint16_t)(identity[0] << 8 | identity[1]);
    bases.channels = (int)number("channels", 4);
    for (int b = 0; at && b < BASES; b++)
        for (int c = 0; c < bases.channels; c++)
            for (int f = 0; f < TICKS; f++) {
                while (*at && *at != '-' && (*at < '0' || *at > '9')) at++;
                bases.scales[b][c][f] = (int16_t)strtol(at, (char **)&at, 10);
            }
    cue_bases_order(&bases);
    printf("{}\n");
}

static void do_push(void) {
    size_t n0 = hex("l0", first_bytes), n1 = hex("l1", second_bytes);
    long index = (long)number("index", 0);
    cue_rule rule;
    int before = payload->started;
    cue_payload_put(payload, first_bytes, n0, second_bytes, n1, 0.64 * (double)index, &rule);
    if (!before && payload->started) shift = payload->last - (int32_t)index;
    printf("{\"section\":\"%s\"}\n", cue_rule_name(rule));
}

static void print_markers(const char *between, long tick, const float *shown) {
    double parameters[MOST_P], place[CUE_MARKERS][3];
    for (int k = 0; k < MOST_P; k++) parameters[k] = (double)shown[k];
    cue_markers_of(&payload->model, parameters, place);
    printf("%s\"%ld\":[", between, tick);
    for (int i = 0; i < CUE_MARKERS; i++)
        printf("%s[%.4f,%.4f,%.4f]", i ? "," : "", place[i][0], place[i][1], place[i][2]);
    printf("]");
}

/* The next number of the request's `frames` from `*at` on, -1 behind the last. */
static long next_frame(const char **at) {
    while (*at && **at && **at != ']' && (**at < '0' || **at > '9')) ++*at;
    return *at && **at && **at != ']' ? strtol(*at, (char **)at, 10) : -1;
}

static int wanted(int32_t tick) {
    const char *at = field("frames");
    for (long t; (t = next_frame(&at)) >= 0;)
        if (t == tick) return 1;
    return 0;
}

static void print_frames(const float (*shown)[MOST_P]) {
    const char *at = field("frames"), *between = "";
    printf(",\"markers\":{");
    for (long t; (t = next_frame(&at)) >= 0; between = ",") print_markers(between, t, shown[t & 31]);
    printf("}");
}

static void do_draw(void) {
    int32_t index = (int32_t)number("index", 0) + shift;
    const cue_slot *s = cue_payload_draw(payload, index, number("lips", 0) != 0);
    if (!s) {
        printf("{\"arrived\":false,\"keys\":[],\"markers\":{}}\n");
        return;
    }
    const char *between = "";
    printf("{\"arrived\":%s,\"keys\":[", s->state == 2 ? "true" : "false");
    const cue_line *joined = &payload->work.line;
    for (int i = 0; i < joined->cues; i++) {
        const cue_cue *key = &joined->cue[i];
        if (!key->certain || cue_floor(key->start, TICKS) != index) continue;
        printf("%s[%d,%d,%d]", between, key->number, key->start - TICKS * shift,
               key->end - TICKS * shift);
        between = ",";
    }
    printf("]");
    print_frames(s->shown);
    printf("}\n");
}

/* A stream file by the events of its superframes; `frames` are ticks of the programme. */
static void do_file(void) {
    enum { MOST = 20000 };
    static int32_t keys[MOST][3], phones[MOST][3];
    static struct { int32_t tick; float values[MOST_P]; } frames[256];
    int n_keys = 0, n_phones = 0, n_frames = 0;
    size_t bytes = hex("file", first_bytes);
    cue_rule rule = cue_payload_file(payload, first_bytes, bytes);
    if (rule != RULE_NONE) {
        printf("{\"valid\":false,\"section\":\"%s\"}\n", cue_rule_name(rule));
        return;
    }
    cue_event event = {.size = sizeof event};
    payload->with_lips = 0;
    while (cue_payload_file_next(payload, first_bytes, bytes) == CUE_OK)
        while (cue_payload_next(payload, &event) == CUE_OK) {
            int32_t tick = (int32_t)lround(50 * event.time_s);
            if (event.kind == CUE_EVENT_KEY && n_keys < MOST) {
                int32_t *key = keys[n_keys++];
                key[0] = PLACEMENTS * event.of.key.shape + event.of.key.placement;
                key[1] = tick;
                key[2] = tick + (int32_t)lround(50 * event.of.key.duration_s);
            } else if (event.kind == CUE_EVENT_PHONE && n_phones < MOST) {
                int32_t *phone = phones[n_phones++];
                phone[0] = event.of.phone.phone;
                phone[1] = tick;
                phone[2] = tick + (int32_t)lround(50 * event.of.phone.duration_s);
            } else if (event.kind == CUE_EVENT_MOTION && wanted(tick)) {
                int at = 0; /* one that is drawn again replaces the earlier one */
                while (at < n_frames && frames[at].tick != tick) at++;
                if (at == 256) continue;
                n_frames = at < n_frames ? n_frames : at + 1;
                frames[at].tick = tick;
                memcpy(frames[at].values, event.of.motion.values, sizeof frames[at].values);
            }
        }
    payload->with_lips = 1;
    printf("{\"valid\":true,\"keys\":[");
    for (int i = 0; i < n_keys; i++)
        printf("%s[%d,%d,%d]", i ? "," : "", keys[i][0], keys[i][1], keys[i][2]);
    printf("],\"phones\":[");
    for (int i = 0; i < n_phones; i++)
        printf("%s[%d,%d,%d]", i ? "," : "", phones[i][0], phones[i][1], phones[i][2]);
    printf("],\"markers\":{");
    for (int i = 0; i < n_frames; i++) print_markers(i ? "," : "", frames[i].tick, frames[i].values);
    printf("}}\n");
}

static void print_hex(const char *name, const uint8_t *bytes, int count) {
    printf("\"%s\":\"", name);
    for (int i = 0; i < count; i++) printf("%02x", bytes[i]);
    printf("\"");
}

/* Samples with the lowest byte first in the byte order of this machine, where they stand. */
static void to_own_order(float *samples, size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint8_t b[4];
        memcpy(b, samples + i, sizeof b);
        uint32_t word = b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
        memcpy(samples + i, &word, sizeof word);
    }
}

/* Superframes of raw float32 samples in a file, by the public interface alone. */
static void do_sound(void) {
    static float samples[4800 * CUE_MOST_CHANNELS];
    char path[1024];
    const char *between = "";
    cue_config config = cue_default_config((uint32_t)number("rate", 0), (uint32_t)number("channels", 0));
    config.key = (uint64_t)number("key", 0);
    size_t bytes = cue_size(&config), frames = 0, width = config.channels * sizeof(float);
    text("path", path, sizeof path);
    FILE *in = bytes ? fopen(path, "rb") : 0;
    cue_state *cue = in ? malloc(bytes) : 0;
    cue_event event = {.size = sizeof event};
    printf("{\"superframes\":[");
    if (cue && cue_init(cue, bytes, &config) == CUE_OK) {
        do {
            frames = fread(samples, width, 4800, in);
            to_own_order(samples, frames * config.channels);
            if ((frames ? cue_push(cue, samples, frames) : cue_flush(cue)) != CUE_OK) break;
            while (cue_next(cue, &event) == CUE_OK) {
                const cue_superframe *s = &event.of.superframe;
                if (event.kind != CUE_EVENT_SUPERFRAME) continue;
                printf("%s{\"at_s\":%.4f,", between, event.time_s);
                print_hex("l0", s->l0, s->l0_bytes);
                printf(",");
                print_hex("l1", s->l1, s->l1_bytes);
                printf("}");
                between = ",";
            }
        } while (frames);
    }
    printf("]}\n");
    free(cue);
    if (in) fclose(in);
}

/* The next whole number of a list, -1 at its end; numbers may be -1 themselves. */
static int list_of(const char *name, int32_t *out, int most) {
    const char *at = field(name);
    int n = 0;
    while (at && *at && *at != ']' && n < most) {
        if (*at == '-' || (*at >= '0' && *at <= '9'))
            out[n++] = (int32_t)strtol(at, (char **)&at, 10);
        else
            at++;
    }
    return n;
}

static void do_step(void) {
    cue_chain chain;
    uint8_t channel[64], key[64];
    hex("channel", channel);
    hex("key", key);
    cue_chain_of(&chain, channel, number("period", 0), (int)number("width", 9));
    cue_chain_before(&chain, key, number("block", 0), 1);
    printf("{");
    print_hex("before", key, KEY_BYTES);
    printf("}\n");
}

static void do_tag(void) {
    uint8_t channel[64], key[64];
    hex("channel", channel);
    hex("key", key);
    size_t bytes = hex("covered", first_bytes);
    printf("{\"tag\":%u}\n",
           cue_tag(channel, key, (int)number("distance", 1), first_bytes, bytes));
}

static void do_agree(void) {
    static const char *const words[3] = {"null", "false", "true"};
    const cue_proof_layout *layout = &cue_proof_layouts[number("width", 9) == 9];
    cue_parities found = {{0}, {0}, {0}};
    list_of("checks", found.check, MOST_CHECKS);
    int count = list_of("tags", found.tag, LONGEST_BLOCK);
    for (int i = 0; i < count; i++) found.missing[i] = found.tag[i] < 0;
    printf("{\"agree\":%s}\n", words[1 + cue_parities_agree(&found, layout, 2)]);
}

static void do_trust(void) {
    size_t bytes = hex("file", first_bytes);
    double tolerance_s = (double)number("tolerance_ms", 10000) / 1000;
    (void)cue_payload_trust(payload, 0, 0, 0, 0, 0);
    if (cue_payload_trust(payload, first_bytes, bytes, tolerance_s, 0, 0) == CUE_OK)
        printf("{\"trusted\":true}\n");
    else
        printf("{\"trusted\":false,\"section\":\"%s\"}\n", cue_payload_broken(payload));
}

static cue_event verdicts[1024];
static int n_verdicts;

static void collect_verdicts(void) {
    if (n_verdicts == 1024) n_verdicts = 0;
    while (n_verdicts < 1024 && cue_proofs_next(&payload->proofs, &verdicts[n_verdicts]) == CUE_OK)
        n_verdicts++;
}

static void do_proof(void) {
    cue_arrived one = {.index = (int32_t)number("index", 0), .agreed = -1};
    size_t bytes = hex("covered", first_bytes);
    one.bytes = (uint8_t)(bytes < COVERED ? bytes : COVERED);
    memcpy(one.covered, first_bytes, one.bytes);
    one.proof = (uint16_t)number("field", 0);
    one.width = (uint8_t)number("width", 9);
    one.utc_s = field("utc_ms") ? (double)number("utc_ms", 0) / 1000 : (double)NAN;
    one.time_s = one.index;
    cue_proofs_add(&payload->proofs, &one);
    collect_verdicts();
    printf("{}\n");
}

static void do_verdicts(void) {
    static const char *const words[4] = {"unknown", "verified", "forged", "unsigned"};
    payload->proofs.started = true;
    cue_proofs_end(&payload->proofs);
    collect_verdicts();
    printf("{\"statuses\":{");
    for (int i = 0; i < n_verdicts; i++)
        printf("%s\"%.0f\":\"%s\"", i ? "," : "", verdicts[i].time_s,
               words[verdicts[i].of.proof.status & 3]);
    printf("}}\n");
    n_verdicts = 0;
}

static void answer(void) {
    char what[32];
    cue_rule rule;
    text("do", what, sizeof what);
    if (!strcmp(what, "hello")) {
        printf("{\"name\":\"cuecast native\",\"protocol\":1,\"format\":%d,"
               "\"does\":[\"superframe\",\"draw\",\"file\",\"proofs\",\"sound\"]}\n", CUE_FORMAT);
    } else if (!strcmp(what, "voice")) {
        printf("{\"loaded\":%s,", load_voice() ? "true" : "false");
        printf("\"malformed_at\":%d}\n", (int)payload->bad_at - 1);
    } else if (!strcmp(what, "bases")) {
        do_bases();
    } else if (!strcmp(what, "superframe")) {
        size_t n0 = hex("l0", first_bytes), n1 = hex("l1", second_bytes);
        rule = cue_superframe_read(first_bytes, n0, second_bytes, n1, &payload->tables, &bases,
                                   &content, &found);
        if (rule != RULE_NONE)
            printf("{\"valid\":false,\"section\":\"%s\"}\n", cue_rule_name(rule));
        else
            print_content();
    } else if (!strcmp(what, "reset")) {
        cue_payload_reset(payload);
        printf("{}\n");
    } else if (!strcmp(what, "push")) {
        do_push();
    } else if (!strcmp(what, "draw")) {
        do_draw();
    } else if (!strcmp(what, "file")) {
        do_file();
    } else if (!strcmp(what, "step")) {
        do_step();
    } else if (!strcmp(what, "tag")) {
        do_tag();
    } else if (!strcmp(what, "agree")) {
        do_agree();
    } else if (!strcmp(what, "trust")) {
        do_trust();
    } else if (!strcmp(what, "proof")) {
        do_proof();
    } else if (!strcmp(what, "verdicts")) {
        do_verdicts();
    } else if (!strcmp(what, "sound")) {
        do_sound();
    } else {
        printf("{\"unsupported\":true}\n");
    }
}

int main(void) {
    cue_config config = {.size = sizeof config, .rate_hz = 48000, .channels = 2};
    payload = malloc(cue_payload_size(&config));
    if (!payload || cue_payload_init(payload, &config) != CUE_OK) return 2;
    while (fgets(line, sizeof line, stdin)) {
        answer();
        fflush(stdout);
    }
    free(payload);
    return 0;
}
