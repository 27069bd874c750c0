/* strokes.c
 * In: keys in order of time, the constants of a voice's movement. Out: strokes of the hand, when
 * each leaves and reaches its key, in hundredths of a tick.
 * Source: lead of the hand over the sound after Attina 2005, chapter VI.
 * Specification: spec/bitstream.md, section 5 (P1 to P3, table 5). */
#include "payload.h"

#include <math.h>

static int64_t whole(double x) {
    return (int64_t)nearbyint(x); /* halves to the even one */
}

static int64_t parts(double seconds) {
    return whole(5000.0 * seconds);
}

static int64_t least(int64_t a, int64_t b) {
    return a < b ? a : b;
}

static int64_t most(int64_t a, int64_t b) {
    return a > b ? a : b;
}

static int64_t free_after(const cue_stroke *s, const double *c) {
    return s->reach - whole(c[OVERLAP] * (double)(s->reach - s->leave));
}

/* The last rule of P1; `raw` is the stroke as the rules before leave it. */
static void add(cue_strokes *list, cue_stroke raw, const double *c) {
    cue_stroke s = raw;
    if (list->count == MOST_STROKES) return;
    if (list->count) {
        const cue_stroke *last = &list->stroke[list->count - 1];
        s.leave = most(s.leave, free_after(last, c));
        s.reach = most(s.reach, most(s.leave, last->reach) + 1);
    }
    list->raw = raw;
    list->stroke[list->count++] = s;
}

static void add_rest(cue_strokes *list, int64_t end, int64_t before, const double *c) {
    int64_t leave = end + parts(c[REST_DELAY]);
    int64_t reach = most(least(leave + parts(c[REST_MOVE]), before), leave + parts(c[SHORTEST]));
    add(list, (cue_stroke){leave, reach, 0}, c);
}

/* P2: whether a superframe was lost between two ticks, so that silence is not known. */
static int is_lost(const cue_sound *sounds, int count, int32_t begin, int32_t end) {
    for (int i = 0; i < count; i++)
        if (sounds[i].open_start && sounds[i].open_end && begin <= sounds[i].start &&
            sounds[i].end <= end)
            return 1;
    return 0;
}

static double way_between(const cue_model *model, unsigned from, unsigned to) {
    double sum = 0.0;
    for (int k = 0; k < 3; k++) {
        double d = (double)model->places[to][k] - (double)model->places[from][k];
        sum += d * d;
    }
    return sqrt(sum);
}

void cue_strokes_begin(cue_strokes *list) {
    list->count = list->dropped = 0;
    list->raw = list->stroke[list->count++] = (cue_stroke){CUE_LONG_AGO, CUE_LONG_AGO, 0};
}

void cue_strokes_key(cue_strokes *list, const cue_cue *before, const cue_cue *cue, int waits,
                     unsigned rest_gap, const cue_model *model) {
    static const int32_t gaps[4] = {12, 25, 50, 90}; /* S9, in ticks */
    const double *c = model->constants;
    int64_t a = 100 * (int64_t)cue->start, lead = parts(c[FIRST_LEAD]);
    int rested = !before || (cue->start - before->end >= gaps[rest_gap & 3] && !waits);
    if (rested && before) { /* P2, P3 */
        int64_t end = 100 * (int64_t)before->end;
        lead = least(lead, (a - end) / 2);
        add_rest(list, end, a - lead, c);
    }
    double way = way_between(model, list->raw.number, cue->number);
    if (!rested) {
        int64_t d = cue->start - before->start, q = least(d, whole(50.0 * c[HURRIED]));
        lead = whole(100.0 * c[LEAD_SHARE]) * q + whole(100.0 * c[CALM_SHARE]) * (d - q);
        lead = least(lead, whole(5000.0 * (c[MOST_LEAD] + c[LEAD_PER_MM] * way)));
        lead = most(lead, parts(c[LEAST_LEAD]));
    }
    int64_t lag = whole(100.0 * c[LAG_SHARE]) * cue->consonant;
    int64_t fast = whole(5000.0 * (1.875 / (1000.0 * c[FASTEST])) * way);
    int64_t leave = most(least(a - lead, a + lag - fast), free_after(&list->raw, c));
    int64_t late = least(leave + fast, a + lag + parts(c[LATE]));
    int64_t reach = most(a + lag, most(late, leave + parts(c[SHORTEST])));
    add(list, (cue_stroke){leave, reach, cue->number}, c);
}

void cue_strokes_end(cue_strokes *list, const cue_cue *last, const cue_model *model) {
    add_rest(list, 100 * (int64_t)last->end, INT64_C(1) << 40, model->constants);
}

void cue_strokes_of(const cue_line *line, unsigned rest_gap, const cue_model *model,
                    cue_strokes *out) {
    cue_strokes_begin(out);
    for (int i = 0; i < line->cues; i++) {
        const cue_cue *cue = &line->cue[i], *before = i ? cue - 1 : 0;
        int waits = before && is_lost(line->sound, line->sounds, before->end, cue->start);
        cue_strokes_key(out, before, cue, waits, rest_gap, model);
    }
    if (line->cues) cue_strokes_end(out, &line->cue[line->cues - 1], model);
}
