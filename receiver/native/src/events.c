/* events.c
 * In: the slots of the timeline. Out: one event at a time, oldest superframe first.
 * Source: what a slot still has to report is marked in it; nothing is queued, so nothing is lost.
 * Specification: spec/bitstream.md, P11, J4; markers are computed when they are asked for. */
#include "payload.h"

#include <string.h>

#define TICK_S 0.02

static cue_status emit_key(const cue_slot *s, int32_t start, int32_t end, unsigned number,
                           cue_event *event, cue_key *key) {
    event->time_s = s->time_s + TICK_S * (start - TICKS * s->number);
    key->duration_s = TICK_S * (end - start);
    key->shape = (uint8_t)(number / PLACEMENTS);
    key->placement = (uint8_t)(number % PLACEMENTS);
    return CUE_OK;
}

static cue_status next_of(cue_payload *p, cue_slot *s, cue_event *event) {
    for (int i = 0; i < s->keys; i++) {
        cue_shown_key *key = &s->key[i];
        if (!key->pending) continue;
        key->pending = 0;
        event->kind = CUE_EVENT_KEY;
        event->of.key.final = key->final;
        event->of.key.previewed = key->previewed;
        event->of.key.phones[0] = key->phones[0];
        event->of.key.phones[1] = key->phones[1];
        event->of.key.revision = key->revision;
        return emit_key(s, key->start, key->end, key->number, event, &event->of.key);
    }
    while (s->told_pending) {
        int i = s->told.count - s->told_pending--, symbol = s->told.symbol[i];
        int end = i + 1 < s->told.count ? s->told.tick[i + 1] : TICKS;
        if (symbol >= 40) continue;
        event->kind = CUE_EVENT_PREVIEW;
        event->of.preview.previewed = 1;
        event->of.preview.revision = 0;
        unsigned key = (unsigned)(PLACEMENTS * (1 + symbol / 5) + 1 + symbol % 5);
        int32_t base = TICKS * s->number;
        return emit_key(s, base + s->told.tick[i], base + end, key, event, &event->of.preview);
    }
    if (s->phones_next < s->phones) {
        int i = s->phones_next++;
        event->kind = CUE_EVENT_PHONE;
        event->time_s = s->time_s + TICK_S * (s->phone[i].start - TICKS * s->number);
        event->of.phone.duration_s = TICK_S * (s->phone[i].end - s->phone[i].start);
        event->of.phone.phone = s->phone[i].number;
        event->of.phone.final = 1;
        return CUE_OK;
    }
    while (s->pending) {
        int t = 0;
        while (!(s->pending >> t & 1U)) t++;
        s->pending &= ~(UINT32_C(1) << t);
        event->kind = CUE_EVENT_MOTION;
        event->time_s = s->time_s + TICK_S * t;
        double middle_s = event->time_s + TICK_S / 2;
        if (middle_s < p->from_s || middle_s > p->until_s) continue;
        event->of.motion.revision = s->revision;
        event->of.motion.count = (uint32_t)p->model.n;
        event->of.motion.layers = s->layers;
        memcpy(event->of.motion.values, s->shown[t], sizeof event->of.motion.values);
        p->marker_slot = s->number % SLOTS;
        p->marker_frame = p->with_markers ? t : -1;
        return CUE_OK;
    }
    return CUE_EMPTY;
}

static cue_status next_markers(cue_payload *p, cue_event *event) {
    const cue_slot *s = &p->slot[p->marker_slot];
    double parameters[MOST_P], place[CUE_MARKERS][3];
    for (int k = 0; k < MOST_P; k++) parameters[k] = (double)s->shown[p->marker_frame][k];
    cue_markers_of(&p->model, parameters, place);
    event->kind = CUE_EVENT_MARKERS;
    event->time_s = s->time_s + TICK_S * p->marker_frame;
    event->of.markers.revision = s->revision;
    event->of.markers.count = CUE_MARKERS;
    for (int i = 0; i < CUE_MARKERS; i++)
        for (int k = 0; k < 3; k++) event->of.markers.place_mm[i][k] = (float)place[i][k];
    p->marker_frame = -1;
    return CUE_OK;
}

cue_status cue_payload_next(cue_payload *p, cue_event *event) {
    int32_t newest = -1;
    memset(&event->of, 0, sizeof event->of);
    if (p->marker_frame >= 0) return next_markers(p, event);
    if (cue_proofs_next(&p->proofs, event) == CUE_OK) return CUE_OK;
    if (p->unreadable) {
        p->unreadable = 0;
        event->kind = CUE_EVENT_UNREADABLE;
        event->time_s = p->started ? p->last_on_air_s : 0.0;
        event->of.unreadable.identity = (uint16_t)p->other;
        event->of.unreadable.version = p->other_version;
        return CUE_OK;
    }
    for (int i = 0; i < SLOTS; i++)
        if (p->slot[i].number > newest) newest = p->slot[i].number;
    for (int32_t k = newest - SLOTS + 1; k <= newest; k++) {
        cue_slot *s = cue_slot_find(p, k);
        if (s && next_of(p, s, event) == CUE_OK) return CUE_OK;
    }
    return CUE_EMPTY;
}
