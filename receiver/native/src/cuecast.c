/* cuecast.c - the public functions: joins hearing and payload, owns the queue of events.
 *
 * The queue holds what the hearing half found, in order. cue_next hands each record to the payload
 * half only when it is taken, so that the order of events does not depend on blocks.
 */
#include <string.h>

#include "hearing.h"

enum { RECORDS = 128, MAGIC = 0x43554501 };

typedef struct record {
    enum { AT_SUPERFRAME = 1, AT_STATE, AT_TIME, AT_CLOCK, AT_END } what;
    cue_reception state;
    double time_s, utc_s;
    cue_superframe superframe;
} record;

struct cue_state {
    uint32_t magic, version;
    cue_config config;
    cue_status last;           /* last error, and the value that caused it */
    double detail;
    cue_reception state;
    double start_s;
    uint32_t lost_run;
    bool ended, full, reads_file;
    double power[CUE_MOST_CHANNELS];
    uint64_t heard, power_count;
    uint32_t first_record, records;
    record queue[RECORDS];
    cue_hearing hearing;
};

static size_t payload_at(void) { return (sizeof(cue_state) + 15) / 16 * 16; }

static cue_payload *payload_of(cue_state *cue) {
    return (cue_payload *)(void *)((unsigned char *)cue + payload_at());
}

static const cue_payload *seen_payload(const cue_state *cue) {
    return (const cue_payload *)(const void *)((const unsigned char *)cue + payload_at());
}

static cue_status fail(cue_state *cue, cue_status status, double detail) {
    cue->last = status;
    cue->detail = detail;
    return status;
}

static bool valid(const cue_config *c) {
    return c->size == sizeof *c && c->rate_hz >= CUE_LEAST_RATE_HZ
           && c->rate_hz <= CUE_LARGEST_RATE_HZ && c->channels >= 1
           && c->channels <= CUE_MOST_CHANNELS && isfinite(c->start_s);
}

uint32_t cue_version(void) { return CUE_VERSION; }

size_t cue_event_size(void) { return sizeof(cue_event); }

cue_config cue_default_config(uint32_t rate_hz, uint32_t channels) {
    cue_config config;
    memset(&config, 0, sizeof config);
    config.size = sizeof config;
    config.rate_hz = rate_hz;
    config.channels = channels;
    config.history = 1;
    return config;
}

size_t cue_size(const cue_config *config) {
    return valid(config) ? payload_at() + cue_payload_size(config) : 0;
}

cue_status cue_init(void *memory, size_t bytes, const cue_config *config) {
    cue_state *cue = memory;
    if (!valid(config)) return CUE_BAD_ARGUMENT;
    if (bytes < cue_size(config) || (uintptr_t)memory % 8) return CUE_NO_MEMORY;
    memset(memory, 0, payload_at());
    cue->magic = MAGIC;
    cue->version = CUE_VERSION;
    cue->config = *config;
    cue->start_s = config->start_s;
    cue_hearing_init(&cue->hearing, config);
    return cue_payload_init(payload_of(cue), config);
}

static bool made(const cue_state *cue) {
    return cue->magic == MAGIC && cue->version == CUE_VERSION;
}

cue_status cue_reset(cue_state *cue, double start_s) {
    if (!made(cue)) return CUE_BAD_STATE;
    if (!isfinite(start_s)) return fail(cue, CUE_BAD_ARGUMENT, start_s);
    cue->start_s = start_s;
    cue->state = CUE_SEARCHING;
    cue->heard = cue->power_count = 0;
    cue->records = cue->lost_run = 0;
    cue->ended = cue->full = cue->reads_file = false;
    cue_hearing_reset(&cue->hearing);
    return cue_payload_reset(payload_of(cue));
}

/* ---- Sound in ------------------------------------------------------------------------------- */

static void add_record(cue_state *cue, record r) {
    if (cue->records == RECORDS) {
        cue->full = true;
        return;
    }
    cue->queue[(cue->first_record + cue->records++) % RECORDS] = r;
}

/* Hand over the superframes that were read. */
static void gather(cue_state *cue) {
    cue_hearing *h = &cue->hearing;
    for (int i = 0; i < h->waiting; i++) {
        record r = {.what = AT_SUPERFRAME, .superframe = h->queue[i]};
        r.superframe.time_s += cue->start_s;
        r.time_s = r.superframe.time_s;
        add_record(cue, r);
    }
    h->waiting = 0;
}

static void step(cue_state *cue) {
    cue_hearing *h = &cue->hearing;
    cue_hearing_step(h);
    gather(cue);
    double now_s = cue->start_s + (double)h->now / FS;
    if (h->state != cue->state) {
        cue->state = h->state;
        add_record(cue, (record){.what = AT_STATE, .state = h->state, .time_s = now_s});
    }
    add_record(cue, (record){.what = AT_TIME, .time_s = now_s});
}

/* W5: the mid of the stereo downmix without LFE, and the side of two channels. */
static void push_frame(cue_state *cue, const float *x) {
    static const float half = 0.5f, centre = 0.70710678f, surround = 0.35355339f;
    uint32_t n = cue->config.channels;
    float mid = x[0], side = 0;
    if (n > 1) {
        mid = half * (x[0] + x[1]);
        if (n == 2) side = half * (x[0] - x[1]);
        if (n == 3 || n >= 5) mid += centre * x[2];
        if (n == 4) mid += surround * (x[2] + x[3]);
        if (n == 5) mid += surround * (x[3] + x[4]);
        if (n >= 6) mid += surround * (x[4] + x[5]);
    }
    for (uint32_t c = 0; c < n; c++) cue->power[c] += (double)x[c] * x[c];
    cue->heard++;
    if (++cue->power_count == cue->config.rate_hz) {
        for (uint32_t c = 0; c < n; c++) {
            double power = cue->power[c] / (double)cue->power_count;
            cue->hearing.seen.level_dbfs[c] = power > 1e-20 ? 3.01029996f * log2f((float)power) : -200;
            cue->power[c] = 0;
        }
        cue->power_count = 0;
    }
    cue_sound_push(&cue->hearing.sound, mid, side);
    while (cue->hearing.sound.count >= cue->hearing.now + QUANTUM) step(cue);
}

static cue_status may_push(cue_state *cue) {
    if (!made(cue)) return CUE_BAD_STATE;
    if (cue->ended || cue->reads_file) return fail(cue, CUE_BAD_STATE, 0);
    return CUE_OK;
}

static cue_status pushed(cue_state *cue) {
    bool full = cue->full;
    cue->full = false;
    return full ? fail(cue, CUE_FULL, RECORDS) : CUE_OK;
}

static float sample(float x) { return fabsf(x) <= 1e3f ? x : 0; } /* NaN compares false */

cue_status cue_push(cue_state *cue, const float *samples, size_t frames) {
    float x[CUE_MOST_CHANNELS];
    cue_status status = may_push(cue);
    if (status != CUE_OK) return status;
    if (!samples && frames) return fail(cue, CUE_BAD_ARGUMENT, 0);
    for (size_t i = 0; i < frames; i++) {
        for (uint32_t c = 0; c < cue->config.channels; c++) x[c] = sample(*samples++);
        push_frame(cue, x);
    }
    return pushed(cue);
}

cue_status cue_push_planar(cue_state *cue, const float *const *channels, size_t frames) {
    float x[CUE_MOST_CHANNELS];
    cue_status status = may_push(cue);
    if (status != CUE_OK) return status;
    if (!channels && frames) return fail(cue, CUE_BAD_ARGUMENT, 0);
    for (size_t i = 0; i < frames; i++) {
        for (uint32_t c = 0; c < cue->config.channels; c++) x[c] = sample(channels[c][i]);
        push_frame(cue, x);
    }
    return pushed(cue);
}

cue_status cue_push_s16(cue_state *cue, const int16_t *samples, size_t frames) {
    float x[CUE_MOST_CHANNELS];
    cue_status status = may_push(cue);
    if (status != CUE_OK) return status;
    if (!samples && frames) return fail(cue, CUE_BAD_ARGUMENT, 0);
    for (size_t i = 0; i < frames; i++) {
        for (uint32_t c = 0; c < cue->config.channels; c++) x[c] = (float)*samples++ / 32768.0f;
        push_frame(cue, x);
    }
    return pushed(cue);
}

cue_status cue_flush(cue_state *cue) {
    static const float nothing[CUE_MOST_CHANNELS] = {0};
    cue_status status = may_push(cue);
    if (status != CUE_OK) return status;
    uint64_t heard = cue->heard;
    int64_t end = cue->hearing.sound.count + HOP + 256 + 2 * QUANTUM;
    while (cue->hearing.sound.count < end) push_frame(cue, nothing);
    cue_hearing_end(&cue->hearing);
    gather(cue);
    cue->heard = heard;
    cue->ended = true;
    cue->state = CUE_ENDED;
    double now_s = cue->start_s + (double)heard / cue->config.rate_hz;
    add_record(cue, (record){.what = AT_END, .time_s = now_s});
    add_record(cue, (record){.what = AT_STATE, .state = CUE_ENDED, .time_s = now_s});
    return pushed(cue);
}

/* ---- Events out ------------------------------------------------------------------------------ */

cue_status cue_next(cue_state *cue, cue_event *event) {
    if (!made(cue)) return CUE_BAD_STATE;
    if (event->size != sizeof *event) return fail(cue, CUE_BAD_ARGUMENT, (double)event->size);
    for (;;) {
        cue_status status = cue_payload_next(payload_of(cue), event);
        event->size = sizeof *event;
        if (status != CUE_EMPTY || !cue->records) return status;
        const record *r = &cue->queue[cue->first_record];
        cue->first_record = (cue->first_record + 1) % RECORDS;
        cue->records--;
        event->time_s = r->time_s;
        switch (r->what) {
        case AT_TIME:
            status = cue_payload_advance(payload_of(cue), r->time_s);
            break;
        case AT_CLOCK:
            cue_payload_clock(payload_of(cue), r->time_s, r->utc_s);
            status = CUE_OK;
            break;
        case AT_END:
            status = cue_payload_flush(payload_of(cue));
            break;
        case AT_STATE:
            event->kind = CUE_EVENT_STATE;
            event->of.state = r->state;
            return CUE_OK;
        case AT_SUPERFRAME:
            status = cue_payload_take(payload_of(cue), &r->superframe);
            if (status < 0) return fail(cue, status, 0);
            if (r->superframe.l0_bytes) {
                cue->lost_run = r->superframe.late ? cue->lost_run : 0;
                event->kind = CUE_EVENT_SUPERFRAME;
                event->of.superframe = r->superframe;
            } else {
                event->kind = CUE_EVENT_LOST;
                event->of.lost = (cue_lost){r->superframe.index, r->superframe.epoch,
                                            ++cue->lost_run};
            }
            return CUE_OK;
        }
        if (status < 0) return fail(cue, status, 0);
    }
}

/* ---- Stream files ----------------------------------------------------------------------------- */

cue_status cue_file_open(cue_state *cue, const void *file, size_t bytes, cue_file_info *info) {
    if (!made(cue)) return CUE_BAD_STATE;
    if (info->size != sizeof *info) return fail(cue, CUE_BAD_ARGUMENT, (double)info->size);
    cue_status status = cue_reset(cue, cue->start_s);
    if (status == CUE_OK) status = cue_payload_open(payload_of(cue), file, bytes, info);
    cue->reads_file = status == CUE_OK;
    return status == CUE_OK ? status : fail(cue, status, (double)bytes);
}

cue_status cue_file_read(cue_state *cue, const void *file, size_t bytes) {
    if (!made(cue)) return CUE_BAD_STATE;
    cue_status status = cue_payload_file_next(payload_of(cue), file, bytes);
    return status >= CUE_OK ? status : fail(cue, status, (double)bytes);
}

/* ---- Voice, trust, diagnosis ------------------------------------------------------------------ */

cue_status cue_voice(cue_state *cue, const void *file, size_t bytes) {
    if (!made(cue)) return CUE_BAD_STATE;
    cue_status status = cue_payload_voice(payload_of(cue), file, bytes);
    return status == CUE_OK ? status : fail(cue, status, (double)bytes);
}

cue_status cue_trust(cue_state *cue, const void *announcement, size_t bytes, double tolerance_s,
                     cue_verify verify, void *context) {
    if (!made(cue)) return CUE_BAD_STATE;
    cue_status status =
        cue_payload_trust(payload_of(cue), announcement, bytes, tolerance_s, verify, context);
    double found = status == CUE_BAD_ARGUMENT ? tolerance_s : (double)bytes;
    return status == CUE_OK ? status : fail(cue, status, found);
}

cue_status cue_clock(cue_state *cue, double utc_s) {
    if (!made(cue)) return CUE_BAD_STATE;
    if (!(fabs(utc_s) < 1e11)) return fail(cue, CUE_BAD_ARGUMENT, utc_s);
    double now_s = cue->start_s + (double)cue->heard / cue->config.rate_hz;
    uint32_t last = (cue->first_record + cue->records - 1) % RECORDS;
    if (cue->records && cue->queue[last].what == AT_CLOCK) cue->records--;
    add_record(cue, (record){.what = AT_CLOCK, .time_s = now_s, .utc_s = utc_s});
    return CUE_OK;
}

cue_status cue_diagnose(const cue_state *cue, cue_diagnosis *d) {
    const cue_hearing *h = &cue->hearing;
    if (!made(cue)) return CUE_BAD_STATE;
    if (d->size != sizeof *d) return CUE_BAD_ARGUMENT;
    *d = h->seen;
    d->size = sizeof *d;
    d->state = cue->state;
    d->rate_hz = cue->config.rate_hz;
    d->heard_s = (double)cue->heard / cue->config.rate_hz;
    for (uint32_t c = 0; c < CUE_MOST_CHANNELS; c++)
        if (c >= cue->config.channels || d->heard_s < 1) d->level_dbfs[c] = -200;
    if (h->tracking) {
        const cue_track *t = &h->track;
        d->clock_ppm = (float)((1 / t->ratio - 1) * 1e6);
        d->gain_db = 5 * t->offset;
        d->pair = h->view.paired;
        d->inverted = t->mix[0] < 0 || (t->mix[0] == 0 && t->mix[1] < 0);
        d->mix = t->mix[1] == 0 ? 0 : t->mix[0] == 0 ? 1 : t->mix[0] == t->mix[1] ? 2 : 3;
    }
    cue_payload_diagnose(seen_payload(cue), d);
    return CUE_OK;
}

cue_status cue_explain(const cue_state *cue, char *text, size_t bytes) {
    cue_diagnosis d;
    d.size = sizeof d;
    if (!made(cue)) return CUE_BAD_STATE;
    cue_status status = cue_diagnose(cue, &d);
    if (status != CUE_OK) return status;
    const char *rule = cue_payload_broken(seen_payload(cue));
    return cue_explain_text(cue->last, cue->detail, rule, &d, text, bytes);
}
